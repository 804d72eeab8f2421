import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.deviation import action_deviations, object_reach
from app.pipeline.episode import Demonstration
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN = np.array([1.0, 0.0, 0.0, 0.0])
OFFSETS_M = ([0.0, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.2])


def pick(x_m, instruction="pick up the cube", yaw_deg=0.0, name="cube", offsets_m=OFFSETS_M, is_open=(1, 0, 0)):
    """A cube beside a wall; the gripper goes above it, down, closes, and lifts."""
    yaw = Rotation.from_euler("z", yaw_deg, degrees=True)
    cube = ObjectPose(name, [x_m, 0.1, 0.8], yaw.as_quat())
    wall = ObjectPose("wall", [0.5, 0.4, 0.9])
    turned = (yaw * Rotation.from_quat(DOWN)).as_quat()
    targets = [EndEffectorAction(cube.position_m + o, turned, bool(g)) for o, g in zip(offsets_m, is_open, strict=True)]
    return Demonstration(instruction, (cube, wall), tuple(targets))


SHOWN = [pick(0.1), pick(0.15, yaw_deg=20), pick(0.2, yaw_deg=-30)]


def test_what_is_done_as_shown_does_not_deviate():
    deviations = action_deviations(pick(0.3, yaw_deg=10), SHOWN)
    assert [item.follows for item in deviations] == ["cube"] * 3
    for item in deviations:
        assert max(item.offset_m, item.spread_m) < 1e-9
        assert max(item.turn_deg, item.turn_spread_deg) < 1e-6


def test_an_action_that_goes_elsewhere_is_distinguished_from_the_others():
    wrong = pick(0.15, offsets_m=([0, 0, 0.1], [0.03, 0.04, 0], [0, 0, 0.2]), is_open=(1, 1, 0))
    deviations = action_deviations(wrong, SHOWN)
    assert [round(item.offset_m, 6) for item in deviations] == [0, 0.05, 0]


def test_other_objects_of_the_same_instruction_are_compared():
    ball = pick(0.3, "pick up the ball", name="ball")
    assert action_deviations(ball, SHOWN)[0].follows == "ball"


@pytest.mark.parametrize("other", [pick(0.1, "push the cube"), pick(0.1, offsets_m=OFFSETS_M[:2], is_open=(1, 0))])
def test_what_was_not_shown_is_not_compared(other):
    assert action_deviations(other, SHOWN) == ()


def test_reach_follows_from_the_demonstrations():
    inside = object_reach(ObjectPose("cube", [0.12, 0.1, 0.8], [0, 0, 0, 1]), SHOWN)
    assert inside.beyond_m == 0
    assert inside.nearest_m == pytest.approx(0.02)
    assert inside.nearest_deg == pytest.approx(0, abs=1e-6)
    beyond = object_reach(ObjectPose("cube", [0.05, 0.13, 0.8]), SHOWN)
    assert beyond.beyond_m == pytest.approx(0.05)
    assert beyond.nearest_deg is None
