"""The poses that one part of a scene allows, the best first, and which of them the evidence tells apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.perception.registered.cloud import Index
from app.perception.registered.poses import Poses, joined
from app.perception.registered.registration import (
    ALL_FREE,
    MAX_RISE_M,
    TURN_ABOUT_Z,
    fallen_starts,
    registered,
    upright_starts,
)
from app.perception.registered.scene import LitScene
from app.perception.registered.score import score
from app.perception.registered.template import Template
from roboprompt_client.arrays import Array

FEW, SOME, MANY, MOST = 110, 160, 250, 800  # points of the scene, from the first look to the last
COARSE_M = (0.05, 0.04, 0.03, 0.03, 0.025, 0.025, 0.02, 0.02)
FINE_M = (0.02, 0.02, 0.015, 0.015, 0.012)
FINAL_M = (0.012, 0.01, 0.01)
HOPELESS = 0.5  # of which score no start becomes good
CLOSE_BY, FEWEST_KEPT, MAX_KEPT = 0.12, 4, 14  # scores so little below the best, and how many in any case
NEARBY_YAWS_DEG = np.array([-10.0, -7, -4, -2, 2, 4, 7, 10])
SURE = 3.0  # standard errors by which the evidence must speak for a pose
MIN_SHARE = 0.02  # of the points, by which it must speak, too


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose with its score; see `Score`.

    Attributes:
        pose: one pose.
        evidence: (E,) or None where the pose was hopeless from the start.
    """

    pose: Poses
    value: float
    support: float
    evidence: Array | None

    @property
    def rotation(self) -> Array:
        """(3, 3)."""
        rotation: Array = self.pose.rotations[0]
        return rotation

    @property
    def origin_m(self) -> Array:
        """(3,)."""
        origin_m: Array = self.pose.origins_m[0]
        return origin_m

    def beats(self, rival: "Hypothesis") -> bool:
        """Whether the points that tell the two apart speak against the rival, beyond chance."""
        if self.evidence is None or rival.evidence is None:
            return self.evidence is not None
        against = np.minimum(self.evidence, 0) - np.minimum(rival.evidence, 0)
        by_chance = SURE * np.sqrt((against**2).sum())
        return bool(against.sum() > max(by_chance, MIN_SHARE * (self.evidence != 0).sum()))


def hypotheses(
    template: Template, lit: LitScene, index: Index, yaws_deg: Array | None = None, *, fallen: bool = False
) -> Sequence[Hypothesis]:
    """Poses that explain the points `index`, the best first; at least one.

    Args:
        yaws_deg: at which to start; all around if left out.
        fallen: whether it lies instead of standing.
    """
    index = np.random.default_rng(0).permutation(index)
    free = ALL_FREE if fallen else TURN_ABOUT_Z
    poses = _starts(template, lit, index, yaws_deg, fallen=fallen)
    few, many = index[:FEW], index[:MANY]
    points_m = lit.scene.points_m
    poses = registered(template, poses, points_m[few], COARSE_M, free=free)
    if not fallen:
        poses = _at_height(template, lit, poses)
    coarse = score(template, lit, few, poses, MANY)
    best = int(coarse.value.argmax())
    if coarse.value[best] < HOPELESS:
        return [Hypothesis(poses[[best]], float(coarse.value[best]), float(coarse.support[best]), None)]
    close = int((coarse.value > coarse.value[best] - CLOSE_BY).sum())
    poses = poses[np.argsort(-coarse.value)[: min(max(FEWEST_KEPT, close), MAX_KEPT)]]
    poses = registered(template, poses, points_m[many], FINE_M, lab=lit.lab[many], free=free)
    if template.yaw_symmetry_deg != 0:
        poses = _best_nearby(template, lit, index[:SOME], poses)
    poses = registered(template, poses, points_m[many], FINAL_M, lab=lit.lab[many], free=free)
    if not fallen:
        poses = _at_height(template, lit, poses)
    final = score(template, lit, index[:MOST], poses, MOST)
    order = np.argsort(-final.value)
    return [Hypothesis(poses[[n]], float(final.value[n]), float(final.support[n]), final.evidence[n]) for n in order]


def _starts(template: Template, lit: LitScene, index: Index, yaws_deg: Array | None, *, fallen: bool) -> Poses:
    points_m = lit.scene.points_m[index]
    if fallen:
        return fallen_starts(template, lit.scene, points_m)
    if yaws_deg is None:
        return upright_starts(template, lit.scene, points_m)
    return upright_starts(template, lit.scene, points_m, yaws_deg)


def _at_height(template: Template, lit: LitScene, poses: Poses) -> Poses:
    """The poses no higher or lower above the table than the object was taught, within what cloths and errors make."""
    plane = lit.scene.table.plane
    taught_m = poses.origins_m[:, :2] @ plane[:2] + plane[2] - template.bottom_m
    height_m = np.clip(poses.origins_m[:, 2], taught_m - MAX_RISE_M, taught_m + MAX_RISE_M)
    return Poses(poses.rotations, np.column_stack([poses.origins_m[:, :2], height_m]))


def _best_nearby(template: Template, lit: LitScene, index: Index, poses: Poses) -> Poses:
    """Each pose, or a better one with a yaw close by: a nearly round body keeps the yaw that its start had."""
    count = len(NEARBY_YAWS_DEG) + 1
    turned = joined(*(poses.turned(number, np.concatenate([[0.0], NEARBY_YAWS_DEG])) for number in range(len(poses))))
    values = score(template, lit, index, turned, SOME).value.reshape(len(poses), count)
    return turned[np.arange(len(poses)) * count + values.argmax(axis=1)]
