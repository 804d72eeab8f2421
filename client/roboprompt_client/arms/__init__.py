"""Arms behind the Robot Protocol: one `Arm`, and a driver for each maker's interface.

A driver's package is an extra and is imported only when such an arm is opened: `roboprompt-client[franka]`, `[ur]`,
`[xarm]`, `[lerobot]`.
"""
