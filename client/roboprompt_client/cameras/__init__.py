"""The cell's cameras: a driver for each kind (`picture` has the Protocol), the rig of all of them, and viewpoints."""
