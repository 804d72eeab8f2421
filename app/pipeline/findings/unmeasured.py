"""Demonstrations of which some have an object's rotation and others have exactly the identity instead."""

import math
from collections.abc import Collection, Iterator, Sequence

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.object_pose import in_millimeters
from app.pipeline.findings.places import DIFFERS_DEG
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import ObjectPose

LEAST = 2  # demonstrations with the identity, and without it: one may be a hand-written pose
STEP_DEG, EXACT_DEG = 15.0, 1e-4  # programs place objects exactly at multiples of it, the identity among them


def unmeasured_findings(demonstrations: Sequence[Demonstration], followed: Collection[str]) -> Iterator[Finding]:
    """Yield a finding for each object whose rotation is exactly 0 in some demonstrations and measured in others.

    Args:
        followed: the objects that rows are relative to.
    """
    for name in sorted(followed):
        poses = [item.object(name) for item in demonstrations if any(pose.name == name for pose in item.objects)]
        unturned = [pose for pose in poses if _lacks_rotation(pose)]
        measured_deg = list(filter(_is_measured, map(_turn_deg, poses)))
        if min(len(unturned), len(measured_deg)) < LEAST or max(measured_deg) < DIFFERS_DEG:
            continue
        message = (
            f"The rotation of {name} is exactly 0 (0, 0, 0, 1) in {len(unturned)} of {len(poses)} demonstrations, and"
            " differs in others. Its estimator probably saw no rotation in them: record them again, or send no"
            " rotation of it in any."
        )
        share = len(unturned) / len(poses)
        yield rules.SOME_ROTATIONS_NOT_MEASURED.finding(message, f"objects[{name}]", {"share": share}, value=share)


def _lacks_rotation(pose: ObjectPose) -> bool:
    """Return whether its rotation is the identity, and its place was not written by hand."""
    turn_xyzw = pose.quaternion_xyzw
    return turn_xyzw is not None and quaternions.is_identity(turn_xyzw) and not in_millimeters(pose)


def _turn_deg(pose: ObjectPose) -> float:
    return 0.0 if pose.quaternion_xyzw is None else math.degrees(quaternions.angle_rad(pose.quaternion_xyzw))


def _is_measured(turn_deg: float) -> bool:
    return abs(turn_deg - STEP_DEG * round(turn_deg / STEP_DEG)) > EXACT_DEG
