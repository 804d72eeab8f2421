"""Arms behind the Robot Protocol: one `Arm`, and a driver for each maker's interface, whose package is an extra."""
