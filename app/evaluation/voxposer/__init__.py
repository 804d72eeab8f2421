"""A baseline after VoxPoser (Huang et al., CoRL 2023, arXiv 2307.05973): no demonstrations, a program over value maps.

A language model, or a person, writes a program (`ask`). It runs in a sandboxed process (`sandbox`, `program`). By
`commands` it paints boxes into maps of 100^3 voxels: targets, obstacles, rotations of the gripper. A planner descends
their cost, and the corners of its path become end-effector actions (`planner`).
"""
