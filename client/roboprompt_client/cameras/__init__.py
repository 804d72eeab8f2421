"""The cell's cameras: a driver for each kind (`rig` has the Protocol), the rig of all of them, and calibration."""
