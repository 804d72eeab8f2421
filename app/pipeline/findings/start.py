"""Where the hand is before the first action, against where recordings start.

Arms start where they did before, or anywhere. What is measured of the hand by other means than recordings were differs
by one offset: flange or fingertips, the base's frame or the world's.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.places import MIN_DEMONSTRATIONS, ShownScenes
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import Pose

TILT_DEG = 5.0  # between the hand's axes, within which it is as it was; flanges are often turned about it
ALONG_M, ACROSS_M = 0.04, 0.015  # a flange is farther from fingertips, and hands that are elsewhere are also beside
BESIDE_M, AT_M = 0.05, 0.025  # from the nearest object's vertical axis: acts beside it, acts at it


def start_findings(now: Pose | None, scenes: ShownScenes) -> tuple[Finding, ...]:
    """Of a motion with rows relative to where the hand starts: it starts where no demonstration does."""
    if now is None or len(scenes.demonstrations) < MIN_DEMONSTRATIONS or scenes.starts is None:
        return ()
    off = scenes.starts.off_box(np.array(now.position_m))
    message = (
        f"The end effector starts {100 * off.far_m:.0f} cm beyond the demonstrations along {off.axis}, which start"
        f" from {off.range_text}, and rows are relative to its start. Is `end_effector` in the world frame?"
    )
    return rules.START_BEYOND.findings(off.doubtful_m, message, "end_effector", {"beyond_m": off.far_m})


def frame_findings(
    now: Pose | None, shown: Sequence[Demonstration], hands: Sequence[RecordedHand]
) -> Iterator[Finding]:
    """Recordings whose hand starts off by an offset that is no motion: along its own axis, or what it acts beside by.

    Args:
        shown: demonstrations, with their `hands`.
    """
    if now is None or len(hands) < MIN_DEMONSTRATIONS:
        return
    ways_m = np.array(now.position_m) - [hand.start.position_m for hand in hands]
    far_m = np.linalg.norm(ways_m, axis=1)
    if far_m.max() < ALONG_M:
        return
    axis = quaternions.rotated(now.quaternion_xyzw, (0, 0, 1))
    axes = np.array([quaternions.rotated(hand.start.quaternion_xyzw, (0, 0, 1)) for hand in hands])
    alike = axes @ axis > np.cos(np.radians(TILT_DEG))
    along_m = np.abs(ways_m @ axis)
    along = alike & (along_m > ALONG_M) & (np.sqrt(np.maximum(far_m**2 - along_m**2, 0)) < ACROSS_M)
    beside = alike & [_acts_beside(*item) for item in zip(ways_m, shown, hands, strict=True)]
    yield from _off("straight along its own axis: flange or fingertips", along, along_m)
    how = "and acts as far beside an object, on the same side: the base's frame or the world's"
    yield from _off(how, beside & ~along, far_m)


def _off(how: str, off: Array, off_m: Array) -> Iterator[Finding]:
    share = float(off.mean())
    if rules.OTHER_FRAME.severity(share) is not None:
        message = (
            f"In {off.sum()} of {len(off)} recordings the hand starts {100 * float(np.median(off_m[off])):.0f} cm from"
            f" `end_effector`, {how}? If the hand is elsewhere now, move it to where recordings start and ask again."
        )
        yield rules.OTHER_FRAME.finding(message, "end_effector", {"share": share}, value=share)


def _acts_beside(way_m: Array, shown: Demonstration, hand: RecordedHand) -> bool:
    """Whether the hand acts beside all objects, and at one if it is moved by `way_m`."""
    beside_m, moved_m = (_beside_m(places_m, shown) for places_m in (hand.acts_at_m, hand.acts_at_m + way_m))
    return bool(((beside_m > BESIDE_M) & (moved_m < AT_M)).any())


def _beside_m(places_m: Array, shown: Demonstration) -> Array:
    """(K,) how far each of K places is from the vertical axis of the nearest object."""
    objects_m = np.array([pose.position_m for pose in shown.objects])
    distances_m: Array = np.linalg.norm(places_m[:, None, :2] - objects_m[None, :, :2], axis=2).min(axis=1)
    return distances_m
