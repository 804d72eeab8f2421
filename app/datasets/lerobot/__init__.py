"""LeRobot datasets, read in versions 3.0, 2.1 and 2.0 and written in 3.0, without the package `lerobot`."""
