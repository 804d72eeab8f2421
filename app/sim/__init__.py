"""A simulated Franka Panda with calibrated cameras and tasks (MuJoCo). Imports pipeline and client only."""

from app.sim.opengl import select_backend

# MuJoCo reads MUJOCO_GL once, when it is first imported; every module of this package imports MuJoCo after this line.
select_backend()
