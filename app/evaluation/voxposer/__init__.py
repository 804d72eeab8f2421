"""A baseline after VoxPoser (Huang et al., CoRL 2023, arXiv 2307.05973): no demonstrations, a program over value maps.

A language model, or a person, writes a program (`ask`). It runs in a sandboxed process (`sandbox`, `program`) and says
by `commands` where the end effector is to go, what it keeps away from and how it is turned there, as boxes painted into
maps of 100^3 voxels. A planner goes down their cost, and corners of its way become end-effector actions (`planner`).
"""
