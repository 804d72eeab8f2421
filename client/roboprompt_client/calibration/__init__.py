"""Where cameras are, from pictures of a ChArUco board; needs the extra `calibrate`."""
