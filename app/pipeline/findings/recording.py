"""Findings about one recording, reported at its upload so that a person can record it again at once."""

from collections.abc import Iterator, Mapping, Sequence, Sized
from typing import Any

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import COMMANDED, Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.acts import AT_OBJECT_M, NEARER_M
from app.pipeline.findings.frames import Compared
from app.pipeline.findings.hand import MOVING_M
from app.pipeline.findings.outliers import gripper_outlier_findings
from app.pipeline.findings.units import unit_findings
from app.pipeline.keyframes import KeyframeRule, Motion, manner_of
from app.pipeline.keyframes.motion import stretches
from app.pipeline.keyframes.rules import MAX_KEYFRAMES
from app.pipeline.order.order import FIELD, Order
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array, positions_array

JUMP_M = 0.05
JUMP_M_S = 3.0  # faster than arms move their hands
LONG_FRAME = 10.0  # times as long as the usual frame: others are missing
COARSE_M = 0.05  # between two frames; poses in between are known to half of that
FAST_SWITCH_M_S = 0.15
FINGERS_MOVE_M = 0.01

PUSHED_M = 0.03  # an object that moves by more near a hand that does not hold it is pushed
NEAR_M = 0.2  # from the object's origin to the hand that pushes it; a tool may be in between
SHORT_M = 0.015  # from the commanded position: more than the error of a controller in free space
STILL_M_S = 0.02  # a slower hand has stopped
LASTS_S = 0.2  # shorter contacts are bumps
PUSHING_N = 8.0  # above the median force; a carried kilogram is 10 N
MOVING_M_S = 0.05  # at the last frame


def upload_findings(
    new: Demonstration,
    motion: Motion,
    rule: KeyframeRule,
    *,
    tracked: Sequence[str],
    compared: Sequence[Compared],
    extra: Mapping[str, Any],
    others: Sequence[Demonstration],
) -> tuple[Finding, ...]:
    """Return the findings about an uploaded demonstration, causes first.

    Args:
        new: the demonstration, with the keyframes that `rule` finds in `motion`.
        tracked: the objects in the order of the trajectory's tracks.
        others: the task's demonstrations.

    Raises:
        InvalidInputError: if `extra` has commanded positions of another shape.
    """
    return (
        *verb_findings(new.order),
        *unit_findings(motion.trajectory, new.objects),
        *compared_findings(compared),
        *recording_findings(motion, new.actions, rule),
        *contact_findings(motion, tracked, extra),
        *gripper_outlier_findings(new, others),
    )


def verb_findings(order: Order) -> Iterator[Finding]:
    """Yield a finding for an instruction that no rule about verbs can compare with the recording."""
    if not order.has_known_verb:
        message = (
            f"No verb in {order.text!r} is known. It is not checked whether the recording fits the words, for example"
            ' that the gripper closes where they say "take".'
        )
        yield Finding("unknown-verb", "info", message, FIELD)


def recording_findings(motion: Motion, keyframes: Sized, rule: KeyframeRule) -> tuple[Finding, ...]:
    """Return the findings, causes first."""
    return (*_steps(motion), *_rotations(motion), *_gripper(motion), *_keyframes(motion, keyframes, rule))


def compared_findings(compared: Sequence[Compared]) -> Iterator[Finding]:
    """Yield a finding of an upload for each object whose given pose differs from the one found in its images."""
    for item in compared:
        if not item.agrees:
            message = (
                f"The given pose of {item.given.name} differs by {100 * item.off_m:.1f} cm and {item.off_deg:.0f}"
                f" degrees from the one found in the images ({item.found.estimator}), which is used. Give the pose of"
                " the same point and axes of the object, or check the camera's calibration."
            )
            numbers = {"off_m": item.off_m, "off_deg": item.off_deg}
            where = f"objects[{item.given.name}].position"
            yield Finding("given-pose-unlike-images", "warning", message, where, numbers)


def _steps(motion: Motion) -> Iterator[Finding]:
    steps_m = np.linalg.norm(np.diff(motion.trajectory.positions_m, axis=0), axis=1)
    lasting_s = np.diff(motion.times_s)
    speeds_m_s = steps_m / np.maximum(lasting_s, 1e-9)
    gaps = lasting_s > LONG_FRAME * np.median(lasting_s) if len(lasting_s) else lasting_s > 0
    jumps = np.flatnonzero((steps_m > JUMP_M) & ((speeds_m_s > JUMP_M_S) | gaps))
    if len(jumps):
        frame = int(jumps[0]) + 1
        message = (
            f"The hand jumps by {100 * steps_m[frame - 1]:.0f} cm from frame {frame - 1} to {frame}"
            f" ({speeds_m_s[frame - 1]:.1f} m/s, {lasting_s[frame - 1]:.2f} s). Record every frame, and"
            " check control_frequency_hz."
        )
        numbers = {"frame": frame, "jump_m": float(steps_m[frame - 1]), "num_jumps": len(jumps)}
        yield Finding("jump", "warning", message, "trajectory.end_effector_positions", numbers)
    moving_m = steps_m[steps_m > MOVING_M]
    if len(moving_m) and (usual_m := float(np.quantile(moving_m, 0.75))) > COARSE_M:
        rate_hz = len(steps_m) / max(float(motion.times_s[-1] - motion.times_s[0]), 1e-9)
        message = (
            f"At {rate_hz:.0f} Hz the hand moves up to {100 * usual_m:.0f} cm between two frames, so that its turns and"
            " grasps are known only to that accuracy. Record at a higher rate, or move more slowly."
        )
        yield Finding("coarse-recording", "warning", message, "trajectory", {"rate_hz": rate_hz, "step_m": usual_m})


def _rotations(motion: Motion) -> Iterator[Finding]:
    if quaternions.is_identity(motion.trajectory.quaternions_xyzw):
        message = (
            "The hand's rotation is exactly 0 (0, 0, 0, 1) in every frame, as of a recorder that knows none. Predicted"
            " actions would turn the hand to it: record its rotation, or the constant one of a hand that cannot turn."
        )
        yield Finding("rotation-not-measured", "warning", message, "trajectory.end_effector_quaternions_xyzw")


def _gripper(motion: Motion) -> Iterator[Finding]:
    if not motion.switches:
        state, widths_m = "open" if motion.trajectory.gripper_open[0] else "closed", motion.trajectory.gripper_width_m
        message = f"The gripper is {state} throughout, which is right only for a task without a grasp."
        if widths_m is not None and (travel_m := float(np.ptp(widths_m))) > FINGERS_MOVE_M:
            message += f" Its fingers move by {100 * travel_m:.1f} cm: check the task's gripper_open_above_m."
            yield Finding("one-gripper-state", "warning", message, "trajectory.gripper_open", {"travel_m": travel_m})
        else:
            yield Finding("one-gripper-state", "info", message, "trajectory.gripper_open")
        return
    speeds_m_s = {switch.frame: float(motion.hand_speeds_m_s[switch.frame]) for switch in motion.acting_switches}
    fast = next((frame for frame, speed_m_s in speeds_m_s.items() if speed_m_s > FAST_SWITCH_M_S), None)
    if fast is not None:
        message = (
            f"The gripper switches while the hand moves at {speeds_m_s[fast]:.2f} m/s (frame {fast}). Record the"
            " measured state of the fingers, not the command."
        )
        numbers = {"frame": fast, "speed_m_s": speeds_m_s[fast]}
        yield Finding("gripper-switches-in-motion", "info", message, "trajectory.gripper_open", numbers)


def _keyframes(motion: Motion, keyframes: Sized, rule: KeyframeRule) -> Iterator[Finding]:
    if rule.rule == "merged" and manner_of(motion, rule.delta_rad_s) != "rests":
        message = (
            f"The hand does not rest at its keyframes, so that the {len(keyframes)} keyframes of the rule merged may"
            " miss parts of the motion. Use the rule auto or waypoints."
        )
        yield Finding("keyframes-miss-the-path", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})
    if len(keyframes) > MAX_KEYFRAMES:
        message = (
            f"There are {len(keyframes)} keyframes, more than {MAX_KEYFRAMES}: the longer a reply, the more goes"
            " wrong. Record shorter tasks, or use the rule auto."
        )
        yield Finding("too-many-keyframes", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})


def contact_findings(motion: Motion, names: Sequence[str], extra: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield findings about contact, and about a recording that ends in motion.

    Args:
        names: the objects that the trajectory tracks, in its order.

    Raises:
        InvalidInputError: if `extra` has commanded positions of another shape.
    """
    yield from _pushed(motion, names)
    if COMMANDED in extra:
        yield from _stopped_short(motion, positions_array(f"extra.{COMMANDED}", extra[COMMANDED], (len(motion), 3)))
    yield from _pressed(motion)
    if (speed_m_s := float(motion.hand_speeds_m_s[-1])) > MOVING_M_S:
        message = f"The hand still moves at {speed_m_s:.2f} m/s in the last frame. Record half a second more."
        yield Finding("ends-in-motion", "info", message, "trajectory", {"speed_m_s": speed_m_s})


def _pushed(motion: Motion, names: Sequence[str]) -> Iterator[Finding]:
    """Yield a finding for each tracked object that moves near a hand that does not hold it."""
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
                f"The hand pushes {name} by {100 * moved_m:.0f} cm without holding it. Poses contain no forces:"
                " predicted actions go to where the hand was, and a more compliant robot pushes less far."
            )
            yield Finding("contact", "info", message, f"objects[{name}]", {"moved_m": moved_m})


def _holds(motion: Motion, away_m: Array) -> bool:
    closed = [away_m[phase.first : phase.last + 1] for phase in motion.phases if not phase.gripper_open]
    return any(each[0] < AT_OBJECT_M and each.min() > each[0] - NEARER_M for each in closed)


def _stopped_short(motion: Motion, commanded_m: Array) -> Iterator[Finding]:
    short_m = np.linalg.norm(commanded_m - motion.trajectory.positions_m, axis=1)
    if (held := _longest(motion, (short_m > SHORT_M) & (motion.hand_speeds_m_s < STILL_M_S))) is not None:
        frame, most_m = held.start, float(short_m[held].max())
        message = (
            f"From frame {frame} on something stops the hand {100 * most_m:.1f} cm short of the commanded position."
            " Predicted actions go to where the hand was, and press less. If your robot is compliant, record the"
            " commanded positions as the trajectory."
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
            f"From frame {frame} on up to {most_n:.0f} N act on the hand. Predicted actions go to where the hand was,"
            " and may press less."
        )
        yield Finding("contact", "info", message, "trajectory", {"frame": frame, "force_n": most_n})


def _longest(motion: Motion, states: npt.ArrayLike) -> slice | None:
    found = [slice(first, end) for first, end, is_so in stretches(states) if is_so]
    lasting = [frames for frames in found if _lasts_s(motion, frames) >= LASTS_S]
    return max(lasting, key=lambda frames: _lasts_s(motion, frames), default=None)


def _lasts_s(motion: Motion, frames: slice) -> float:
    return float(motion.times_s[frames.stop - 1] - motion.times_s[frames.start])
