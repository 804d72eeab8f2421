"""Objects that stand in one arrangement in every demonstration, whatever the words name."""

import numpy as np
import pytest
from app.pipeline.findings.demonstrated_scenes import ShownScenes, arrangement_findings

from app.pipeline.episode import Query
from tests.pipeline.scenes import demonstration, pose, rotated

WORDS = "press here"
LID_M = np.array([0.08, 0.0, 0.1])


def kitchen(k, turns=True, lid_off_m=(0, 0, 0), moves=True):
    """A pot with a lid on it, a cup anywhere, and a stove that never moves."""
    pot_m = np.array([0.05 * k, 0.03 * (k % 3), 0.8]) * (1 if moves else 0)
    yaw_deg = 25.0 * k if turns else 0.0
    lid_m = pot_m + rotated(0, 0, yaw_deg).apply(LID_M) + lid_off_m
    cup_m = (0.3 - 0.02 * k, 0.07 * (k % 4), 0.8)
    return (
        pose("pot", pot_m, yaw_deg),
        pose("lid", lid_m, yaw_deg),
        pose("cup", cup_m),
        pose("stove", (0.4, 0.4, 0.8)),
    )


def shown(number=6, **how):
    return [demonstration(WORDS, kitchen(k, **how), []) for k in range(number)]


def found(lid_off_m, followed=(), **how):
    query = Query(WORDS, kitchen(2.5, lid_off_m=lid_off_m, **how))
    return [f.severity for f in arrangement_findings(query, ShownScenes(tuple(shown(**how))), frozenset(followed))]


def pairs(demonstrations):
    return [{pair.one, pair.other} for pair in ShownScenes(tuple(demonstrations)).pairs]


@pytest.mark.parametrize("turns", [True, False])
def test_only_what_is_rigid_and_was_elsewhere_is_a_pair(turns):
    assert pairs(shown(turns=turns)) == [{"pot", "lid"}]
    assert pairs(shown(moves=False)) == []
    assert pairs(shown(2)) == []


@pytest.mark.parametrize("turns", [True, False])
@pytest.mark.parametrize("off_m", [0.07, 0.12, 0.18])
def test_what_was_parted_is_a_danger_where_the_motion_follows_it(turns, off_m):
    assert found((0, off_m, 0), ["lid"], turns=turns) == ["danger"]
    assert found((0, off_m, 0), ["pot"], turns=turns) == ["danger"]
    assert found((0, off_m, 0), ["cup"], turns=turns) == ["warning"]


def test_as_it_was_shown_and_a_little_off_is_no_doubt():
    assert found((0, 0, 0), ["lid"]) == []
    assert found((0.01, 0.02, 0), ["lid"]) == []
    assert found((0.04, 0, 0), ["lid"]) == ["danger"]


def cups(left_m, right_m, names=("left cup", "right cup")):
    return tuple(pose(name, (0.1, y_m, 0.8)) for name, y_m in zip(names, (left_m, right_m), strict=True))


@pytest.mark.parametrize(
    ("names", "left_m", "number", "expected"),
    [
        (("left cup", "right cup"), -0.2, 8, ["danger"]),
        (("left cup", "right cup"), -0.2, 7, []),
        (("left cup", "right cup"), 0.2, 8, []),
        (("red cup", "blue cup"), -0.2, 8, []),
    ],
)
def test_a_left_and_a_right_one_on_each_others_side(names, left_m, number, expected):
    words = f"take the {names[0]}"
    taught = [demonstration(words, cups(0.1 + 0.02 * k, -0.1 - 0.03 * k, names), []) for k in range(number)]
    query = Query(words, cups(left_m, 0.0, names))
    assert [f.severity for f in arrangement_findings(query, ShownScenes(tuple(taught)), frozenset())] == expected
