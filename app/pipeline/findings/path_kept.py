"""Whether actions keep to the recorded path: to the places where hands act, and to the way between them."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrated_scenes import distances_m
from app.pipeline.findings.hand import Kept
from app.pipeline.findings.rules import PATH_LEFT_BY_SOME, PATH_NOT_KEPT, PATH_NOT_KEPT_BETWEEN
from app.pipeline.keyframes import Motion, manner_of
from app.pipeline.keyframes.resting import path_left_m
from app.pipeline.plans.rows import of_a_way
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

NEVER_M = 1.0  # the distance from a switch that no action makes


def kept(motion: Motion, actions: Sequence[EndEffectorAction], delta_rad_s: float) -> Kept:
    """Return how far at least one action is from a recording; an arm slower than `delta_rad_s` rests."""
    return Kept(missed_m(motion, actions), path_left_m(motion, manner_of(motion, delta_rad_s), actions))


def missed_m(motion: Motion, actions: Sequence[EndEffectorAction]) -> float:
    """Return the distance of the actions from where the recorded hand acts; of several places, the farthest.

    The hand acts where the gripper switches; the nearest action with the same gripper state counts. Without a switch it
    acts at its lowest place, which the straight path from action to action may pass.
    """
    positions_m = motion.trajectory.positions_m
    if not motion.acting_switches:
        lowest_m = positions_m[int(positions_m[:, 2].argmin())]
        way_m = np.array([positions_m[0], *(action.position_m for action in actions)])
        return float(distances_m(way_m, lowest_m).min())
    return max(
        min(off_from_m(positions_m[frame], opens, a) for a in actions) for frame, opens in motion.acting_switches
    )


def off_from_m(place_m: Array, is_open: bool, action: EndEffectorAction) -> float:
    """Return the distance of an action from a place; `NEVER_M` for another gripper state."""
    return float(np.linalg.norm(action.position_m - place_m)) if action.gripper_open == is_open else NEVER_M


def path_findings(paths: Sequence[Kept]) -> Iterator[Finding]:
    """Yield a finding if actions miss where hands act, or leave their path, in more than a third of the recordings.

    An object that is not lifted is dragged, and may pull others along. A straight way that more than half of the
    recordings take is demonstrated, so that leaving the path of the others is no danger.
    """
    if not paths:
        return
    missed_m, left_m = map(of_a_way, np.transpose(paths))
    remedy = (
        "Set keyframes.rule to `auto` or `waypoints`, and keyframes.tolerance_m to 0.01. If they already are, the"
        " motion has more corners than a reply has actions: teach its parts as separate tasks."
    )
    if PATH_NOT_KEPT.severity(missed_m) is not None:
        number = sum(PATH_NOT_KEPT.severity(path.missed_m) is not None for path in paths)
        message = (
            f"In {number} of {len(paths)} recordings no keyframe is where the hand grasps, releases or is lowest:"
            f" the actions stay {100 * missed_m:.1f} cm away from there. {remedy}"
        )
        yield PATH_NOT_KEPT.finding(message, "keyframes", {"missed_m": missed_m}, value=missed_m)
    elif PATH_NOT_KEPT_BETWEEN.severity(left_m) is not None:
        number = sum(PATH_NOT_KEPT_BETWEEN.severity(path.left_m) is not None for path in paths)
        rule = PATH_LEFT_BY_SOME if 2 * number < len(paths) else PATH_NOT_KEPT_BETWEEN
        message = (
            f"In {number} of {len(paths)} recordings the hand leaves the straight path from action to action by"
            f" {100 * left_m:.1f} cm: a lift, or a path around an object, may be lost. {remedy}"
        )
        yield rule.finding(message, "keyframes", {"left_m": left_m}, value=left_m)
