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
STILL_M_S = 0.02  # a hand that is so slow has come to where it gets
LASTS_S = 0.2  # what is shorter is a bump
PUSHING_N = 8.0  # beyond what usually acts on the hand; a kilogram that is carried is 10 N
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
    yield from _pressed(motion)
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
    if (held := _longest(motion, (short_m > SHORT_M) & (motion.hand_speeds_m_s < STILL_M_S))) is not None:
        frame, most_m = held.start, float(short_m[held].max())
        message = (
            f"From frame {frame} on the hand stands still {100 * most_m:.1f} cm short of where it was sent: something"
            " holds it. Predicted actions go where the hand was, and press less. Record the commanded positions as the"
            " trajectory, if your robot yields to contact."
        )
        yield Finding("contact", "warning", message, "trajectory", {"frame": frame, "short_m": most_m})


def _pressed(motion: Motion) -> Iterator[Finding]:
    wrenches = motion.trajectory.wrenches_n_nm
    if wrenches is None:
        return
    forces_n = np.linalg.norm(wrenches[:, :3] - np.median(wrenches[:, :3], axis=0), axis=1)
    if (pressed := _longest(motion, forces_n > PUSHING_N)) is not None:
        frame, most_n = pressed.start, float(forces_n[pressed].max())
        message = (
            f"From frame {frame} on up to {most_n:.0f} N act on the hand. Predicted actions go where the hand was, and"
            " do not press as hard by themselves."
        )
        yield Finding("contact", "info", message, "trajectory", {"frame": frame, "force_n": most_n})


def _longest(motion: Motion, states: Array) -> slice | None:
    """The longest stretch of frames of a state (T,); None if none lasts."""

    def lasts_s(frames: slice) -> float:
        return float(motion.times_s[frames.stop - 1] - motion.times_s[frames.start])

    found = max((slice(first, end) for first, end, is_so in stretches(states) if is_so), key=lasts_s, default=None)
    return None if found is None or lasts_s(found) < LASTS_S else found
