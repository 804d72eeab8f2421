import numpy as np
import pytest

from app.pipeline.keyframes import Motion, authors, merged, uniform
from roboprompt_client.types.trajectory import Trajectory

SPEEDS_RAD_S = {"m": 0.5, ".": 0.0}


def trajectory(motion, gripper=None, velocities=None):
    """`motion` has one character a frame: `m` moves, `.` rests; `gripper` one as well: 1 open, 0 closed."""
    length = len(motion)
    if velocities is None:
        velocities = np.zeros((length, 7))
        velocities[:, 3] = [SPEEDS_RAD_S[character] for character in motion]
    is_open = [character == "1" for character in gripper or "1" * length]
    return Trajectory(velocities, np.zeros((length, 3)), np.tile([0, 0, 0, 1], (length, 1)), is_open)


@pytest.mark.parametrize(
    ("motion", "gripper", "expected"),
    [
        # each run's last frame
        ("mmm..mmm...", None, (4, 10)),
        # the gripper's change inside a run; the last of two; on the run's first frame
        ("mmm....mmm...", "1111100000000", (5, 12)),
        ("mmm......mm..", "1111001110000", (6, 9, 12)),
        ("mmm....mmm...", "1110000000000", (3, 12)),
        # on the frame after a run it is outside
        ("mmm..mmmmm...", "1111100000000", (4, 5, 12)),
        # outside every run
        ("mmmmmmmmmm", "1111000000", (4, 9)),
        # the run from frame 0 is dropped, with the change inside it
        ("...mmmmm", None, (7,)),
        ("...mmmmm", "10000000", (7,)),
        ("....", None, (3,)),
        # a keyframe within 3 frames stands for the final one
        ("mmmmmmmmmm", "1111110000", (6,)),
        ("mmmmmmmmmm", "1111100000", (5, 9)),
        ("mmmm..mmm", None, (5,)),
        ("mm", None, (1,)),
        ("m", None, ()),
        (".", None, ()),
    ],
)
def test_merged(motion, gripper, expected):
    assert merged(Motion.of(trajectory(motion, gripper))) == expected


@pytest.mark.parametrize(
    ("motion", "gripper", "expected"),
    [
        # a dwell fires at 0 (never a keyframe) and then every 5 frames; the last two frames never stop
        ("." * 12, None, (5, 11)),
        ("." * 13, None, (5, 10, 12)),
        ("." * 14, None, (5, 10, 13)),
        ("mmm.m.m.mmmmm", None, (3, 12)),
        ("mmm.mmm.mmmmm", None, (3, 12)),
        # no wrap-around: frames before the first count as the first
        ("m.mmmmmmmmmm", "111111110000", (1, 8, 11)),
        ("." * 12, "111111111000", (5, 9, 11)),
        # the gripper must be steady from two before to one after
        ("mmmm.mmmmm", "1111100000", (5, 9)),
        ("mmmm.mmmmm", "1100000000", (2, 4, 9)),
        # a stop needs two frames after it
        ("mmmmmmmm.m", None, (9,)),
        # of two last consecutive keyframes the first goes; only at the end
        ("mmmmmmm", "1111100", (6,)),
        ("mmmmmmmmmm", "1110111111", (3, 4, 9)),
        ("mm", None, (1,)),
        ("m", None, ()),
        (".", None, ()),
    ],
)
def test_authors(motion, gripper, expected):
    assert authors(Motion.of(trajectory(motion, gripper))) == expected


@pytest.mark.parametrize(
    ("length", "interval", "expected"),
    [(11, 5, (5, 10)), (13, 5, (5, 10, 12)), (4, 1, (1, 2, 3)), (3, 40, (2,)), (1, 5, ())],
)
def test_uniform(length, interval, expected):
    assert uniform(Motion.of(trajectory("m" * length)), interval) == expected


def test_merged_takes_the_norm_strictly_below_delta_authors_each_joint_inclusively():
    at_delta = np.full((10, 7), 0.5)
    at_delta[4] = [0.1, 0, 0, 0, 0, 0, 0]
    assert merged(Motion.of(trajectory("m" * 10, velocities=at_delta)), 0.1) == (9,)
    assert authors(Motion.of(trajectory("m" * 10, velocities=at_delta)), 0.1) == (4, 9)
    spread = np.full((10, 7), 0.5)
    spread[4] = -0.05  # a norm of 0.13
    assert merged(Motion.of(trajectory("m" * 10, velocities=spread)), 0.1) == (9,)
    assert merged(Motion.of(trajectory("m" * 10, velocities=spread)), 0.14) == (4, 9)
    assert authors(Motion.of(trajectory("m" * 10, velocities=spread)), 0.1) == (4, 9)
    assert authors(Motion.of(trajectory("m" * 10, velocities=spread)), 0.04) == (9,)
