"""The keyframes of the demonstration whose scene is nearest, carried out as they were shown."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.ledger import poses_of
from app.evaluation.results import TaughtEpisode
from app.pipeline.geometry import canonical_pose
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

LEVER_M = 0.1  # a turn counts as far as it moves a point at this distance; the length of KAT's triplets


def replayed(
    taught: Sequence[TaughtEpisode],
    instruction: str,
    objects: Sequence[ObjectPose],
    yaw_symmetry_deg: Mapping[str, float],
) -> tuple[EndEffectorAction, ...]:
    """The keyframes that the service found in the demonstration whose object poses are nearest to `objects`.

    Only demonstrations of the same instruction are considered, where there are any. The distance is the sum over the
    objects of their shifts in meters and of their turns times 10 cm, up to their symmetry.
    """
    alike = [item for item in taught if item.recorded.scene.instruction == instruction] or list(taught)
    observed = {pose.name: canonical_pose(pose, yaw_symmetry_deg.get(pose.name)) for pose in objects}

    def distance_m(item: TaughtEpisode) -> float:
        poses = poses_of(item.document)
        return sum(_distance_m(canonical_pose(p, yaw_symmetry_deg.get(p.name)), observed[p.name]) for p in poses)

    nearest = min(alike, key=distance_m)
    return tuple(nearest.recorded.trajectory.action_at(item["index"]) for item in nearest.document["keyframes"])


def _distance_m(a: ObjectPose, b: ObjectPose) -> float:
    shift_m = float(np.linalg.norm(a.position_m - b.position_m))
    if a.quaternion_xyzw is None or b.quaternion_xyzw is None:
        return shift_m
    turn_rad = (Rotation.from_quat(a.quaternion_xyzw).inv() * Rotation.from_quat(b.quaternion_xyzw)).magnitude()
    return shift_m + LEVER_M * float(turn_rad)
