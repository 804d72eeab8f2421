"""What is odd in a recording: reported when it is uploaded, so that the person can record it again at once."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import stretches
from app.pipeline.findings import Finding
from app.pipeline.findings.sources import Compared
from app.pipeline.keyframes import Keyframe, KeyframeRule, Motion, manner_of
from app.pipeline.keyframes.rule import MAX_KEYFRAMES
from roboprompt_client.errors import InvalidInputError

MIN_MOTION_M = 0.005
MIN_MOTION_DEG = 3.0
JUMP_M = 0.05
JUMP_M_S = 3.0  # faster than arms move their hands
COARSE_M = 0.05  # between two frames; poses are known no closer than a half of that
SHORT_S = 0.5
IDLE_S = 5.0
IDLE_M_S = 0.002
FAST_SWITCH_M_S = 0.15


def check_moves(motion: Motion) -> None:
    """Refuse a recording in which nothing happens.

    Raises:
        InvalidInputError: if the hand neither moves nor turns and the gripper stays as it is.
    """
    trajectory = motion.trajectory
    away_m = float(np.linalg.norm(trajectory.positions_m - trajectory.positions_m[0], axis=1).max())
    alike = np.clip(np.abs(trajectory.quaternions_xyzw @ trajectory.quaternions_xyzw[0]), 0, 1)
    turned_deg = float(np.degrees(2 * np.arccos(alike)).max())
    if away_m < MIN_MOTION_M and turned_deg < MIN_MOTION_DEG and not motion.gripper_changes:
        message = f"moves the hand by {1000 * away_m:.1f} mm and {turned_deg:.1f} degrees in {len(motion)} frames"
        raise InvalidInputError("trajectory", message, "a demonstration in which the robot moves: record it again")


def recording_findings(motion: Motion, keyframes: Sequence[Keyframe], rule: KeyframeRule) -> tuple[Finding, ...]:
    """What deserves a look, the cause first.

    Args:
        rule: by which the keyframes were found.
    """
    return (
        *_jumps(motion),
        *_coarse(motion),
        *_short(motion),
        *_idle(motion),
        *_gripper(motion),
        *_rule(motion, keyframes, rule),
        *_keyframes(keyframes),
    )


def compared_findings(compared: Sequence[Compared]) -> Iterator[Finding]:
    """Objects of a recording whose given poses are not those that its images show, which is what prompts have."""
    for item in compared:
        if not item.agrees:
            message = (
                f"The pose that was given of {item.given.name} is {100 * item.off_m:.1f} cm and {item.off_deg:.0f}"
                f" degrees from the one that its images show ({item.found.estimator}), which is the one that counts."
            )
            numbers = {"off_m": item.off_m, "off_deg": item.off_deg}
            where = f"objects[{item.given.name}].position"
            yield Finding("given-pose-unlike-images", "warning", message, where, numbers)


def _jumps(motion: Motion) -> Iterator[Finding]:
    steps_m = np.linalg.norm(np.diff(motion.trajectory.positions_m, axis=0), axis=1)
    speeds_m_s = steps_m / np.maximum(np.diff(motion.times_s), 1e-9)
    jumps = np.flatnonzero((steps_m > JUMP_M) & (speeds_m_s > JUMP_M_S))
    if len(jumps):
        frame = int(jumps[0]) + 1
        message = (
            f"The hand jumps by {100 * steps_m[frame - 1]:.0f} cm from frame {frame - 1} to {frame}"
            f" ({speeds_m_s[frame - 1]:.1f} m/s): frames are missing, or control_frequency_hz is wrong."
        )
        numbers = {"frame": frame, "jump_m": float(steps_m[frame - 1]), "num_jumps": len(jumps)}
        yield Finding("jump", "warning", message, "trajectory.end_effector_positions", numbers)


def _coarse(motion: Motion) -> Iterator[Finding]:
    steps_m = np.linalg.norm(np.diff(motion.trajectory.positions_m, axis=0), axis=1)
    moving_m = steps_m[steps_m > MIN_MOTION_M]
    if len(moving_m) and (usual_m := float(np.quantile(moving_m, 0.75))) > COARSE_M:
        rate_hz = len(steps_m) / max(float(motion.times_s[-1] - motion.times_s[0]), 1e-9)
        message = (
            f"At {rate_hz:.0f} Hz the hand moves up to {100 * usual_m:.0f} cm between two frames: where it turned or"
            " grasped is known no better. Record more often, or move more slowly."
        )
        yield Finding("coarse-recording", "warning", message, "trajectory", {"rate_hz": rate_hz, "step_m": usual_m})


def _short(motion: Motion) -> Iterator[Finding]:
    duration_s = float(motion.times_s[-1])
    if duration_s < SHORT_S:
        message = f"The recording takes {duration_s:.2f} s in {len(motion)} frames: is control_frequency_hz right?"
        yield Finding("short-recording", "info", message, "trajectory", {"duration_s": duration_s})


def _idle(motion: Motion) -> Iterator[Finding]:
    times_s = motion.times_s
    idle = [(first, end) for first, end, still in stretches(motion.hand_speeds_m_s < IDLE_M_S) if still]
    longest_s = max((float(times_s[end - 1] - times_s[first]) for first, end in idle), default=0.0)
    if longest_s > IDLE_S:
        message = f"The hand stands still for {longest_s:.0f} s; this leaves no keyframe."
        yield Finding("long-rest", "info", message, "trajectory", {"rest_s": longest_s})


def _gripper(motion: Motion) -> Iterator[Finding]:
    if not motion.switches:
        state = "open" if motion.trajectory.gripper_open[0] else "closed"
        message = f"The gripper is {state} all the time: right for a task without a grasp."
        yield Finding("one-gripper-state", "info", message, "trajectory.gripper_open")
        return
    speeds_m_s = {switch.frame: float(motion.hand_speeds_m_s[switch.frame]) for switch in motion.acting_switches}
    fast = next((frame for frame, speed_m_s in speeds_m_s.items() if speed_m_s > FAST_SWITCH_M_S), None)
    if fast is not None:
        message = (
            f"The gripper switches while the hand moves at {speeds_m_s[fast]:.2f} m/s (frame {fast}):"
            " record what the fingers have done, not the command."
        )
        numbers = {"frame": fast, "speed_m_s": speeds_m_s[fast]}
        yield Finding("gripper-switches-in-motion", "info", message, "trajectory.gripper_open", numbers)


def _keyframes(keyframes: Sequence[Keyframe]) -> Iterator[Finding]:
    if len(keyframes) > MAX_KEYFRAMES:
        message = (
            f"{len(keyframes)} keyframes are more than the {MAX_KEYFRAMES} actions that a prediction may have by"
            " default: record shorter tasks, or use the rule auto."
        )
        yield Finding("too-many-keyframes", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})


def _rule(motion: Motion, keyframes: Sequence[Keyframe], rule: KeyframeRule) -> Iterator[Finding]:
    if rule.rule == "merged" and manner_of(motion, rule.delta_rad_s) != "rests":
        message = (
            f"The recording does not rest at its keyframes: the rule merged finds {len(keyframes)}, which may miss"
            " what the hand does between. Use the rule auto or waypoints."
        )
        yield Finding("keyframes-miss-the-path", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})
