"""What is odd in a recording: reported when it is uploaded, so that the person can record it again at once."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.findings.sources import Compared
from app.pipeline.keyframes import Keyframe, KeyframeRule, manner_of
from app.pipeline.keyframes.rule import MAX_KEYFRAMES
from app.pipeline.keyframes.waypoints import at_start, gripper_switches, hand_speeds_m_s
from roboprompt_client.arrays import Array
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import Trajectory

MIN_MOTION_M = 0.005
MIN_MOTION_DEG = 3.0
JUMP_M = 0.05
JUMP_M_S = 3.0  # faster than arms move their hands
COARSE_M = 0.05  # between two frames; poses are known no closer than a half of that
SHORT_S = 0.5
IDLE_S = 5.0
IDLE_M_S = 0.002
FAST_SWITCH_M_S = 0.15


def check_moves(trajectory: Trajectory) -> None:
    """Refuse a recording in which nothing happens.

    Raises:
        InvalidInputError: if the hand neither moves nor turns and the gripper stays as it is.
    """
    away_m = float(np.linalg.norm(trajectory.positions_m - trajectory.positions_m[0], axis=1).max())
    alike = np.clip(np.abs(trajectory.quaternions_xyzw @ trajectory.quaternions_xyzw[0]), 0, 1)
    turned_deg = float(np.degrees(2 * np.arccos(alike)).max())
    changes = bool(np.diff(trajectory.gripper_open).any())
    if away_m < MIN_MOTION_M and turned_deg < MIN_MOTION_DEG and not changes:
        message = f"moves the hand by {1000 * away_m:.1f} mm and {turned_deg:.1f} degrees in {len(trajectory)} frames"
        raise InvalidInputError("trajectory", message, "a demonstration in which the robot moves: record it again")


def recording_findings(
    trajectory: Trajectory, times_s: Array, keyframes: Sequence[Keyframe], rule: KeyframeRule
) -> tuple[Finding, ...]:
    """What deserves a look, the cause first.

    Args:
        times_s: (T,) of the frames.
        rule: by which the keyframes were found.
    """
    return (
        *_jumps(trajectory, times_s),
        *_coarse(trajectory, times_s),
        *_short(trajectory, times_s),
        *_idle(trajectory, times_s),
        *_gripper(trajectory, times_s),
        *_rule(trajectory, times_s, keyframes, rule),
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


def _jumps(trajectory: Trajectory, times_s: Array) -> Iterator[Finding]:
    steps_m = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    speeds_m_s = steps_m / np.maximum(np.diff(times_s), 1e-9)
    jumps = np.flatnonzero((steps_m > JUMP_M) & (speeds_m_s > JUMP_M_S))
    if len(jumps):
        frame = int(jumps[0]) + 1
        message = (
            f"The hand jumps by {100 * steps_m[frame - 1]:.0f} cm from frame {frame - 1} to {frame}"
            f" ({speeds_m_s[frame - 1]:.1f} m/s): frames are missing, or control_frequency_hz is wrong."
        )
        numbers = {"frame": frame, "jump_m": float(steps_m[frame - 1]), "num_jumps": len(jumps)}
        yield Finding("jump", "warning", message, "trajectory.end_effector_positions", numbers)


def _coarse(trajectory: Trajectory, times_s: Array) -> Iterator[Finding]:
    steps_m = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    moving_m = steps_m[steps_m > MIN_MOTION_M]
    if len(moving_m) and (usual_m := float(np.quantile(moving_m, 0.75))) > COARSE_M:
        rate_hz = len(steps_m) / max(float(times_s[-1] - times_s[0]), 1e-9)
        message = (
            f"At {rate_hz:.0f} Hz the hand moves up to {100 * usual_m:.0f} cm between two frames: where it turned or"
            " grasped is known no better. Record more often, or move more slowly."
        )
        yield Finding("coarse-recording", "warning", message, "trajectory", {"rate_hz": rate_hz, "step_m": usual_m})


def _short(trajectory: Trajectory, times_s: Array) -> Iterator[Finding]:
    if times_s[-1] < SHORT_S:
        message = f"The recording takes {times_s[-1]:.2f} s in {len(trajectory)} frames: is control_frequency_hz right?"
        yield Finding("short-recording", "info", message, "trajectory", {"duration_s": float(times_s[-1])})


def _idle(trajectory: Trajectory, times_s: Array) -> Iterator[Finding]:
    still = hand_speeds_m_s(trajectory, times_s) < IDLE_M_S
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    longest_s = max((float(times_s[end - 1] - times_s[first]) for first, end in edges.reshape(-1, 2)), default=0.0)
    if longest_s > IDLE_S:
        message = f"The hand stands still for {longest_s:.0f} s; this leaves no keyframe."
        yield Finding("long-rest", "info", message, "trajectory", {"rest_s": longest_s})


def _gripper(trajectory: Trajectory, times_s: Array) -> Iterator[Finding]:
    switches = gripper_switches(trajectory, times_s)
    if not switches:
        state = "open" if trajectory.gripper_open[0] else "closed"
        message = f"The gripper is {state} all the time: right for a task without a grasp."
        yield Finding("one-gripper-state", "info", message, "trajectory.gripper_open")
        return
    speeds_m_s = hand_speeds_m_s(trajectory, times_s)
    fast = [s for s in switches if not at_start(s, trajectory) and speeds_m_s[s.frame] > FAST_SWITCH_M_S]
    if fast:
        frame = fast[0].frame
        message = (
            f"The gripper switches while the hand moves at {speeds_m_s[frame]:.2f} m/s (frame {frame}):"
            " record what the fingers have done, not the command."
        )
        numbers = {"frame": frame, "speed_m_s": float(speeds_m_s[frame])}
        yield Finding("gripper-switches-in-motion", "info", message, "trajectory.gripper_open", numbers)


def _keyframes(keyframes: Sequence[Keyframe]) -> Iterator[Finding]:
    if len(keyframes) > MAX_KEYFRAMES:
        message = (
            f"{len(keyframes)} keyframes are more than the {MAX_KEYFRAMES} actions that a prediction may have by"
            " default: record shorter tasks, or use the rule auto."
        )
        yield Finding("too-many-keyframes", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})


def _rule(
    trajectory: Trajectory, times_s: Array, keyframes: Sequence[Keyframe], rule: KeyframeRule
) -> Iterator[Finding]:
    if rule.rule == "merged" and manner_of(trajectory, times_s, rule.delta_rad_s) != "rests":
        message = (
            f"The recording does not rest at its keyframes: the rule merged finds {len(keyframes)}, which may miss"
            " what the hand does between. Use the rule auto or waypoints."
        )
        yield Finding("keyframes-miss-the-path", "warning", message, "keyframes", {"num_keyframes": len(keyframes)})
