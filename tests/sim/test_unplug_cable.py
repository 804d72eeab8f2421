"""The socket holds the plug until it is pulled."""

from app.sim.robot import SimulatedPanda
from app.sim.tasks import make_task


def test_grasping_the_plug_does_not_unplug_it():
    task = make_task("unplug_cable", 0)
    above, grasp, out, _ = task.expert()
    robot = SimulatedPanda(task, cameras=())
    plugged_m = task.position_m("cable")
    robot.perform([above, grasp])
    assert task.events == []
    assert abs(task.position_m("cable") - plugged_m).max() < 0.002
    robot.perform([out])
    assert task.events == ["unplugged"]
    assert task.succeeded()
