"""Poses that explain one part of a scene, the best first, with evidence to distinguish them: ICP from many starts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.registered.depth_view import Index, lengths
from app.perception.registered.icp import ALL_FREE, COARSE_M, FINAL_M, FINE_M, UPRIGHT, Poses, about_z, icp
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.score import same_color, score
from app.perception.registered.template import MAX_RISE_M, Template
from roboprompt_client.types.arrays import Array

FEW, SOME, MANY, MOST = 110, 160, 250, 800  # points of the scene in each stage, from coarse to final
HOPELESS = 0.5  # no refinement follows if the best coarse score is lower
CLOSE_BY, FEWEST_KEPT, MAX_KEPT = 0.12, 4, 14  # poses whose score is so close to the best are kept; their number
NEARBY_YAWS_DEG = (0.0, -10.0, -7, -4, -2, 2, 4, 7, 10)
# A surface alone does not say where along it an object is, its ends do: steps along it that are tried.
LEAST_STEP_M, STEPS, MAX_SLIDES = 0.006, (1.0, 2.0), 3
HEADINGS = np.array([[np.cos(yaw), np.sin(yaw), 0.0] for yaw in np.radians(np.arange(0, 360, 45))])
SURE = 3.0  # standard errors of evidence that one pose needs over another
MIN_SHARE = 0.02  # least evidence for that, relative to the number of points

START_YAWS_DEG = np.arange(0, 360, 15.0)
FEW_SEEN = 20  # with fewer visible points, use all points of the template
FALLS = Rotation.from_euler("xyz", [[90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0], [180, 0, 0]], degrees=True)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose with its score; see `Score`.

    Attributes:
        pose: one pose.
        evidence: (E,), or None if the coarse score was hopeless.
        color: 0..1, see `same_color`; a factor of `value`.
    """

    pose: Poses
    value: float
    support: float
    evidence: Array | None
    color: float = 1.0

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

    @property
    def template_to_world(self) -> Array:
        """(4, 4)."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotation, self.origin_m
        return pose

    @property
    def yaw_deg(self) -> float:
        """Of the template's x axis about the vertical."""
        return float(np.degrees(np.arctan2(self.rotation[1, 0], self.rotation[0, 0])))

    def beats(self, rival: "Hypothesis") -> bool:
        """Return whether the evidence favors this pose over the rival significantly."""
        if self.evidence is None or rival.evidence is None:
            return self.evidence is not None
        against = np.minimum(self.evidence, 0) - np.minimum(rival.evidence, 0)
        by_chance = SURE * np.sqrt((against**2).sum())
        return bool(against.sum() > max(by_chance, MIN_SHARE * (self.evidence != 0).sum()))


def hypotheses(
    template: Template, lit: LitScene, index: Index, yaws_deg: Array = START_YAWS_DEG, *, fallen: bool = False
) -> Sequence[Hypothesis]:
    """Return poses that explain the points `index`, the best first; at least one.

    Args:
        yaws_deg: starting yaws.
        fallen: whether the object lies on its side.
    """
    index = np.random.default_rng(0).permutation(index)
    free = ALL_FREE if fallen else UPRIGHT
    points_m = lit.scene.points_m
    few, many = index[:FEW], index[:MANY]
    if fallen:
        poses = _fallen_starts(template, lit.scene, points_m[index])
    else:
        poses = _upright_starts(template, lit.scene, points_m[index], yaws_deg)
    poses = icp(template, poses, points_m[few], COARSE_M, free=free)
    if not fallen:
        poses = _at_height(template, lit, poses)
    coarse = score(template, lit, few, poses, MANY)
    best = int(coarse.value.argmax())
    if coarse.value[best] < HOPELESS:
        return [Hypothesis(poses[[best]], float(coarse.value[best]), float(coarse.support[best]), None)]
    close = int((coarse.value > coarse.value[best] - CLOSE_BY).sum())
    poses = poses[np.argsort(-coarse.value)[: min(max(FEWEST_KEPT, close), MAX_KEPT)]]
    poses = icp(template, poses, points_m[many], FINE_M, lab=lit.lab[many], free=free)
    if template.yaw_symmetry_deg != 0:
        poses = _best_nearby(template, lit, index[:SOME], poses)
    poses = icp(template, poses, points_m[many], FINAL_M, lab=lit.lab[many], free=free)
    if not fallen:
        poses = _at_height(template, lit, poses)
    return _ranked(template, lit, index[:MOST], poses)


def _ranked(template: Template, lit: LitScene, index: Index, poses: Poses) -> Sequence[Hypothesis]:
    """Return the poses with their scores, the best first."""
    final = score(template, lit, index, poses, MOST)
    colors = np.array([same_color(template, lit, index, poses[[n]]) for n in range(len(poses))])
    values, order = final.value * colors, np.argsort(-final.value * colors)
    return [
        Hypothesis(poses[[n]], float(values[n]), float(final.support[n]), final.evidence[n], float(colors[n]))
        for n in order
    ]


def slid(template: Template, lit: LitScene, index: Index, best: Hypothesis) -> Hypothesis:
    """Return an upright pose, moved to where the points `index` and the images agree with its ends, too.

    ICP leaves it where it started along its surfaces: their points fit anywhere on them. What ICP takes back is
    decided by surfaces, and so is a round object's place.
    """
    if best.evidence is None or template.yaw_symmetry_deg == 0:
        return best
    index = np.random.default_rng(0).permutation(index)
    many, points_m = index[:MANY], lit.scene.points_m
    step_m = max(LEAST_STEP_M, lit.scene.pixel_m(best.origin_m))
    for _ in range(MAX_SLIDES):
        poses = moved(best.pose, step_m * np.concatenate([step * HEADINGS for step in STEPS]))
        poses = _at_height(template, lit, icp(template, poses, points_m[many], FINAL_M, lab=lit.lab[many]))
        poses = poses[lengths(poses.origins_m - best.origin_m) > step_m / 2]
        first = max((best, *_ranked(template, lit, index[:MOST], poses)), key=lambda item: item.value)
        if first is best:
            break
        best = first
    return best


def moved(pose: Poses, offsets_m: Array) -> Poses:
    """Return one pose at each of the offsets (S, 3)."""
    return Poses(np.repeat(pose.rotations, len(offsets_m), axis=0), pose.origins_m + offsets_m)


def _upright_starts(template: Template, scene: Scene, points_m: Array, yaws_deg: Array) -> Poses:
    """Return upright poses on the table at each yaw (S,), their visible sides centered on the points (P, 3)."""
    if template.yaw_symmetry_deg == 0:
        yaws_deg = yaws_deg[:1]
    poses = _over(template, scene, points_m, about_z(yaws_deg))
    # `bottom_m` is where the table was below the template.
    poses.origins_m[:, 2] = scene.table.level_m(points_m.mean(axis=0)) - template.bottom_m
    return poses


def _fallen_starts(template: Template, scene: Scene, points_m: Array) -> Poses:
    """Return poses that lie on each side, or upside down, at each yaw."""
    rotations = np.concatenate([about_z(START_YAWS_DEG[::2]) @ fall for fall in FALLS.as_matrix()])
    poses = _over(template, scene, points_m, rotations)
    lowest_m = (template.points_m @ rotations.transpose(0, 2, 1))[..., 2].min(axis=1)
    poses.origins_m[:, 2] = scene.table.level_m(points_m.mean(axis=0)) - lowest_m
    return poses


def _over(template: Template, scene: Scene, points_m: Array, rotations: Array) -> Poses:
    """Return poses of these rotations whose visible sides are centered on the points."""
    middle_m = points_m.mean(axis=0)
    rays = np.array([view.eye_m - middle_m for view in scene.views])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    turned_m = template.points_m @ rotations.transpose(0, 2, 1)
    is_seen = ((template.normals @ rotations.transpose(0, 2, 1)) @ rays.T > 0.1).any(axis=2)
    is_seen[is_seen.sum(axis=1) <= FEW_SEEN] = True
    shown_m = (turned_m * is_seen[..., None]).sum(axis=1) / is_seen.sum(axis=1)[:, None]
    return Poses(rotations, middle_m - shown_m)


def _at_height(template: Template, lit: LitScene, poses: Poses) -> Poses:
    """Return the poses with heights limited to the taught height above the table, within a tolerance."""
    plane = lit.scene.table.plane
    taught_m = poses.origins_m[:, :2] @ plane[:2] + plane[2] - template.bottom_m
    height_m = np.clip(poses.origins_m[:, 2], taught_m - MAX_RISE_M, taught_m + MAX_RISE_M)
    return Poses(poses.rotations, np.column_stack([poses.origins_m[:, :2], height_m]))


def _best_nearby(template: Template, lit: LitScene, index: Index, poses: Poses) -> Poses:
    """Return each pose with the best yaw close by, since ICP hardly changes the yaw of a nearly round body."""
    count = len(NEARBY_YAWS_DEG)
    rotations = (about_z(NEARBY_YAWS_DEG) @ poses.rotations[:, None]).reshape(-1, 3, 3)
    turned = Poses(rotations, np.repeat(poses.origins_m, count, axis=0))
    values = score(template, lit, index, turned, SOME).value.reshape(len(poses), count)
    return turned[np.arange(len(poses)) * count + values.argmax(axis=1)]
