"""What poses do not carry: pushing against things, and what happens after the last frame."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from app.pipeline.episode import stretches
from app.pipeline.findings import Finding
from app.pipeline.findings.hand import AT_OBJECT_M, NEARER_M
from app.pipeline.keyframes import Motion
from roboprompt_client.arrays import Array, positions_array

COMMANDED = "commanded_positions"  # in `extra`: where the hand was sent, (T, 3) m, world frame
PUSHED_M = 0.03  # an object that the hand moves so far without holding it is pushed
NEAR_M = 0.2  # from the object's origin to the hand that pushes it; tools may be in between
SHORT_M = 0.015  # of where it was sent: more than controllers are off where nothing is in the way
STILL_M_S, STILL_S = 0.02, 0.2  # a hand that is so slow for so long has come to where it gets
MOVING_M_S = 0.05  # at the last frame


def contact_findings(motion: Motion, names: Sequence[str], extra: Mapping[str, Any]) -> Iterator[Finding]:
    """Of a recording that lives from contact, or ends while something moves.

    Args:
        names: of the objects that the trajectory tracks, in its order.

    Raises:
        InvalidInputError: if `extra` has commanded positions of another shape.
    """
    yield from _pushed(motion, names)
    if COMMANDED in extra:
        yield from _stopped_short(motion, positions_array(f"extra.{COMMANDED}", extra[COMMANDED], (len(motion), 3)))
    if (speed_m_s := float(motion.hand_speeds_m_s[-1])) > MOVING_M_S:
        message = f"The hand moves at {speed_m_s:.2f} m/s in the last frame: record half a second more."
        yield Finding("ends-in-motion", "info", message, "trajectory", {"speed_m_s": speed_m_s})


def _pushed(motion: Motion, names: Sequence[str]) -> Iterator[Finding]:
    """Tracked objects that move beside a hand that never holds anything near them."""
    tracks_m = motion.trajectory.object_positions_m
    if tracks_m is None:
        return
    for name, track_m in zip(names, tracks_m.transpose(1, 0, 2), strict=True):
        away_m = np.linalg.norm(track_m - motion.trajectory.positions_m, axis=1)
        if _holds(motion, away_m):
            continue
        steps_m = np.linalg.norm(np.diff(track_m, axis=0), axis=1)
        moved_m = float(steps_m[(away_m[1:] < NEAR_M)].sum())
        if moved_m > PUSHED_M and np.linalg.norm(track_m[-1] - track_m[0]) > PUSHED_M:
            message = (
                f"The hand moves {name} by {100 * moved_m:.0f} cm without holding it. Poses do not carry how hard it"
                " pushes: predicted actions go where the hand was, and a robot that yields more gets less far."
            )
            yield Finding("contact", "info", message, f"objects[{name}]", {"moved_m": moved_m})


def _holds(motion: Motion, away_m: Array) -> bool:
    """Whether the hand closes on an object; a fist that then comes nearer to it has closed on nothing.

    Args:
        away_m: (T,) of the object from the hand.
    """
    closed = [away_m[phase.first : phase.last + 1] for phase in motion.phases if not phase.gripper_open]
    return any(each[0] < AT_OBJECT_M and each.min() > each[0] - NEARER_M for each in closed)


def _stopped_short(motion: Motion, commanded_m: Array) -> Iterator[Finding]:
    short_m = np.linalg.norm(commanded_m - motion.trajectory.positions_m, axis=1)
    stopped = (short_m > SHORT_M) & (motion.hand_speeds_m_s < STILL_M_S)
    pressing = [(first, end) for first, end, is_so in stretches(stopped) if is_so]
    pressing = [(first, end) for first, end in pressing if motion.times_s[end - 1] - motion.times_s[first] >= STILL_S]
    if pressing:
        first, end = max(pressing, key=lambda each: float(short_m[each[0] : each[1]].max()))
        frame, most_m = first, float(short_m[first:end].max())
        message = (
            f"From frame {frame} on the hand stands still {100 * most_m:.1f} cm short of where it was sent: something"
            " holds it. Predicted actions go where the hand was, and press less. Record the commanded positions as the"
            " trajectory, if your robot yields to contact."
        )
        yield Finding("contact", "warning", message, "trajectory", {"frame": frame, "short_m": most_m})
