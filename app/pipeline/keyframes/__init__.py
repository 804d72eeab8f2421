"""Keyframes of a trajectory: the robot rests, or the gripper opens or closes (paper, section III-B)."""

from app.pipeline.keyframes.motion import Manner, Motion
from app.pipeline.keyframes.resting import manner_of
from app.pipeline.keyframes.rules import (
    RULES,
    SIMULATION_DELTA_RAD_S,
    Keyframe,
    KeyframeRule,
    RuleName,
    authors,
    merged,
    uniform,
    waypoints,
)
from roboprompt_client.errors import InvalidInputError

__all__ = [
    "RULES",
    "SIMULATION_DELTA_RAD_S",
    "Keyframe",
    "KeyframeRule",
    "Manner",
    "Motion",
    "RuleName",
    "authors",
    "find_keyframes",
    "manner_of",
    "merged",
    "uniform",
    "waypoints",
]

NEED_JOINTS = ("merged", "authors")
WAVER = 1.5  # a hand that hesitates strays further from its way than one that flows


def find_keyframes(motion: Motion, rule: KeyframeRule) -> tuple[Keyframe, ...]:
    """The keyframes, ascending. Frame 0 is never one: the initial pose is always the same.

    Raises:
        InvalidInputError: if the rule goes by joint velocities and there are none.
    """
    if motion.trajectory.num_joints == 0 and rule.rule in NEED_JOINTS:
        message = f"is missing, by which the rule {rule.rule} finds rests"
        raise InvalidInputError(
            "trajectory.joint_velocities", message, "the rule auto, waypoints or uniform, or (T, J)"
        )
    chosen, waver = rule.rule, 1.0
    if chosen == "auto":
        manner = manner_of(motion, rule.delta_rad_s)
        chosen = "merged" if manner == "rests" else "waypoints"
        waver = WAVER if manner == "hesitates" else 1.0
    if chosen == "waypoints":
        return waypoints(motion, waver * rule.tolerance_m, waver * rule.tolerance_deg)
    if chosen == "merged":
        frames = merged(motion, rule.delta_rad_s)
    elif chosen == "authors":
        frames = authors(motion, rule.delta_rad_s)
    else:
        frames = uniform(motion, rule.interval)
    return tuple(Keyframe(frame, bool(motion.trajectory.gripper_open[frame])) for frame in frames)
