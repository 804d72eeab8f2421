"""Tasks whose objects move by themselves in tests, and rest in demonstrations; beside the tasks of the paper."""

from app.sim.tasks.moving.carried_cube import PickDrifting, PickFromConveyor

MOVING = (PickFromConveyor, PickDrifting)
