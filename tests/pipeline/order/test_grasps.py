"""What instructions ask the gripper to do."""

import pytest

from app.pipeline.order.grasps import put_to
from app.pipeline.order.order import Order

NAMES = ("red cube", "blue cube", "plate", "box")


@pytest.mark.parametrize(
    ("instruction", "goals"),
    [
        ("put 2 red blocks on the plate", ("plate",)),
        ("stacking red cube on plate", ("plate",)),
        ("the robot places the red cube onto the blue cube", ("blue cube",)),
        ("the red cube is put in the box", ("box",)),
        ("take the red cube and put it on the plate", ("plate",)),
        ("put the red cube and the blue cube in the box", ("box",)),
        ("put the red cube on the plate, then the blue cube in the box", ("plate", "box")),
        ("put the red cube that is on the plate in the box", ("box",)),
        ("pick up the red cube on the plate and put it in the box", ("box",)),
        ("move the red cube into the box", ("box",)),
        ("take the red cube from the box", ()),
        ("put the red cube next to the plate", ()),
        ("press the red cube on the plate", ()),
    ],
)
def test_where_something_is_put(instruction, goals):
    assert put_to(Order(instruction, NAMES)) == goals
