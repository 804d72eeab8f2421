"""Half of the recordings press once and half press twice, or strike: alignment gives both the same number of rows."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.plans.recording import Recording

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from app.pipeline.order.order import Order
from app.pipeline.plans import aligned_by_plan
from app.services.predict.demonstrations import hands_of
from roboprompt_client.types.poses import ObjectPose

from ..recordings import arrival_s, flowing, resting

HZ = 20.0
HOME_M = np.array([0.3, 0.0, 1.1])
MOVES = {"at rest": resting, "flowing": flowing}
STROKES = {"press": "press the button", "strike": "hit the button with the hammer"}


def recorded(number, kind, times, move, random):
    """The hand comes over the button and goes down to it so many times; to strike, it fetches a hammer first."""
    button_m, hammer_m = (
        random.uniform((0.2, -0.3, 0.8), (0.4, -0.1, 0.8)),
        random.uniform((0.2, 0.1, 0.8), (0.4, 0.3, 0.8)),
    )
    above_m, fetch = np.array([0, 0, 0.1]), kind == "strike"
    fetched_m = [hammer_m + above_m, hammer_m, hammer_m + above_m] if fetch else []
    stops_m = [HOME_M, *fetched_m, button_m + above_m, *[button_m, button_m + above_m] * times]
    made = move(stops_m)
    switches = (arrival_s(made, hammer_m) + made.rest_s / 2,) if fetch else ()
    motion = Motion.of(replace(made, switches=switches, starts_open=fetch).at(HZ), HZ)
    rule, trajectory = KeyframeRule(), motion.trajectory
    actions = tuple(
        trajectory.action_at(frame, gripper_open=is_open) for frame, is_open in find_keyframes(motion, rule)
    )
    objects = (ObjectPose("button", button_m), *([ObjectPose("hammer", hammer_m)] if fetch else []))
    return Recording(
        Demonstration(STROKES[kind], objects, actions, f"e{number}", start=trajectory.action_at(0)), motion, rule
    )


def severities(times, kind, move, seed=0):
    random = np.random.default_rng(seed)
    recordings = [recorded(k, kind, number, MOVES[move], random) for k, number in enumerate(times)]
    shown = aligned_by_plan(recordings)
    found = Taught(shown, hands=hands_of(recordings, shown)).findings(
        Order(STROKES[kind], tuple(pose.name for pose in shown[0].objects))
    )
    return {finding.severity for finding in found}


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("kind", STROKES)
@pytest.mark.parametrize("more", [2, 3])
def test_half_of_the_recordings_with_more_strokes_are_a_danger(kind, move, more):
    assert "danger" in severities([1, more] * 5, kind, move)


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("kind", STROKES)
@pytest.mark.parametrize("seed", range(3))
def test_equally_many_strokes_are_none(kind, move, seed):
    assert "danger" not in severities([1 + seed % 2] * 10, kind, move, seed)
