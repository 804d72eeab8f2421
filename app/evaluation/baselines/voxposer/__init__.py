"""A baseline after VoxPoser (Huang et al., CoRL 2023, arXiv 2307.05973): no demonstrations, a program over value maps.

A language model writes a program (`prompt`). It runs in a sandboxed process (`sandbox`, `program`) and says where the
end effector is to go, what it keeps away from and how it is turned there, as maps of 100^3 voxels. A planner goes down
their cost (`planner`), and its waypoints become end-effector actions (`plan`). `ask` is the whole way.
"""
