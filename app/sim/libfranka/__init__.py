"""A task's scene behind libfranka's own network protocol, and the Franka driver that teaches and acts in it.

The protocol's servers are franky-sim's, arm and objects are those of the task's MuJoCo scene, and what moves the arm is
`roboprompt_client.arms.franka`, as in a laboratory. Needs the extra `franka`.
"""
