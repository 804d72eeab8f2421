"""Recordings that live from contact, and those that end while something moves."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.recording import contact_findings

from app.pipeline.keyframes import Motion
from roboprompt_client.errors import InvalidInputError

from ..recordings import pick_and_place, resting

BLOCK_M, GOAL_M = np.array([0.3, 0.0, 0.02]), np.array([0.3, 0.2, 0.02])
OTHER_M = np.array([0.3, -0.4, 0.02])
STOPS_M = ((0.1, -0.2, 0.4), (0.3, -0.08, 0.02), (0.3, 0.12, 0.02), (0.3, 0.12, 0.3))


def pushing(hz=20):
    """A closed hand that pushes a block from behind, without tracks."""
    return resting(STOPS_M, starts_open=False).at(hz)


def tracked(trajectory, follows):
    """With a block that keeps to `follows` (T, 3), and another object that stays."""
    other_m = np.broadcast_to(OTHER_M, follows.shape)
    return replace(trajectory, object_positions_m=np.stack([follows, other_m], axis=1))


def pushed_track(hand_m):
    """(T, 3) where a block is that a hand pushes along y."""
    reach = (np.abs(hand_m[:, 2] - BLOCK_M[2]) < 0.03) * (hand_m[:, 1] + 0.08)
    along_m = np.maximum.accumulate(np.maximum(reach, 0.0))
    return BLOCK_M + np.outer(along_m, [0, 1, 0])


def found(trajectory, extra=None):
    return {item.code: item for item in contact_findings(Motion.of(trajectory), ("block", "other"), extra or {})}


def test_an_object_that_moves_without_being_held_is_pushed():
    trajectory = pushing()
    finding = found(tracked(trajectory, pushed_track(trajectory.positions_m)))["contact"]
    assert (finding.severity, finding.where) == ("info", "objects[block]")
    assert finding.numbers["moved_m"] == pytest.approx(0.2, abs=0.03)


def test_an_object_that_is_carried_is_not():
    trajectory = pick_and_place(BLOCK_M, GOAL_M, move=resting, start_m=(0.1, -0.2, 0.4)).at(20)
    closed = ~np.asarray(trajectory.gripper_open)
    track_m = np.where(closed[:, None], trajectory.positions_m, BLOCK_M)
    track_m[np.flatnonzero(closed)[-1] :] = GOAL_M
    assert "contact" not in found(tracked(trajectory, track_m))


def test_without_tracks_nothing_is_known_of_it():
    assert found(pushing()) == {}


@pytest.mark.parametrize(("short_m", "code"), [(0.05, "contact"), (0.005, None)])
def test_a_hand_that_stands_still_short_of_where_it_was_sent_is_held_by_something(short_m, code):
    trajectory = pushing()
    commanded_m = trajectory.positions_m - [0, 0, short_m]
    extra = {"commanded_positions": commanded_m.tolist()}
    assert list(found(trajectory, extra)) == ([code] if code else [])
    if code:
        assert found(trajectory, extra)[code].severity == "warning"
        assert found(trajectory, extra)[code].numbers["short_m"] == pytest.approx(short_m)


@pytest.mark.parametrize("commanded", ["up", [[0.1, 0.2, 0.3]], [[float("nan")] * 3] * len(pushing())])
def test_commanded_positions_of_another_shape_are_refused(commanded):
    with pytest.raises(InvalidInputError, match=r"extra\.commanded_positions"):
        found(pushing(), {"commanded_positions": commanded})


@pytest.mark.parametrize(("force_n", "frames", "code"), [(20.0, 10, "contact"), (20.0, 2, None), (4.0, 10, None)])
def test_forces_that_last_are_contact(force_n, frames, code):
    trajectory = pushing()
    wrenches = np.full((len(trajectory), 6), 3.0)  # of the hand's own weight, say
    wrenches[20 : 20 + frames, 1] += force_n
    assert list(found(replace(trajectory, wrenches_n_nm=wrenches))) == ([code] if code else [])
