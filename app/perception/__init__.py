"""Object poses from what the robot sees: one estimator a file, one Protocol (`base.PoseEstimator`)."""
