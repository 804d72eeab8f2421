"""Objects with ArUco or AprilTag markers on them, or on fixtures that hold them."""
