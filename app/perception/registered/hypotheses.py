"""The poses that one part of a scene allows, the best first, and which of them the evidence tells apart.

From many starts at once by iterative closest points: point to plane, a little point to point, robust.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.registered.geometry import Index, Poses, about_z
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.score import score
from app.perception.registered.template import LAB_AS_M, Template
from roboprompt_client.types.arrays import Array

FEW, SOME, MANY, MOST = 110, 160, 250, 800  # points of the scene, from the first look to the last
COARSE_M = (0.05, 0.04, 0.03, 0.03, 0.025, 0.025, 0.02, 0.02)
FINE_M = (0.02, 0.02, 0.015, 0.015, 0.012)
FINAL_M = (0.012, 0.01, 0.01)
HOPELESS = 0.5  # of which score no start becomes good
CLOSE_BY, FEWEST_KEPT, MAX_KEPT = 0.12, 4, 14  # scores so little below the best, and how many in any case
NEARBY_YAWS_DEG = (0.0, -10.0, -7, -4, -2, 2, 4, 7, 10)
SURE = 3.0  # standard errors by which the evidence must speak for a pose
MIN_SHARE = 0.02  # of the points, by which it must speak, too

MAX_RISE_M = 0.025  # from the taught height above the table: a cloth, a calibration's error
START_YAWS_DEG = np.arange(0, 360, 15.0)
MAX_TURN_RAD = 0.2  # a step
POINT_TO_POINT, POINT_TO_POINT_COLORED = 0.02, 0.06  # its weight beside point to plane: holds what could slide
DAMPING_RAD2, DAMPING_M2 = 1e-4, 1e-2
FEW_SEEN = 20  # points: with fewer, all of the template stand for its visible side
TURN_ABOUT_Z = [2, 3, 4, 5]  # upright: of (3,) rotation and (3,) translation these are free
ALL_FREE = [0, 1, 2, 3, 4, 5]
FALLS = Rotation.from_euler("xyz", [[90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0], [180, 0, 0]], degrees=True)


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
        """Whether the points that tell the two apart speak against the rival, beyond chance."""
        if self.evidence is None or rival.evidence is None:
            return self.evidence is not None
        against = np.minimum(self.evidence, 0) - np.minimum(rival.evidence, 0)
        by_chance = SURE * np.sqrt((against**2).sum())
        return bool(against.sum() > max(by_chance, MIN_SHARE * (self.evidence != 0).sum()))


def hypotheses(
    template: Template, lit: LitScene, index: Index, yaws_deg: Array = START_YAWS_DEG, *, fallen: bool = False
) -> Sequence[Hypothesis]:
    """Poses that explain the points `index`, the best first; at least one.

    Args:
        yaws_deg: at which to start.
        fallen: whether it lies instead of standing.
    """
    index = np.random.default_rng(0).permutation(index)
    free = ALL_FREE if fallen else TURN_ABOUT_Z
    points_m = lit.scene.points_m
    few, many = index[:FEW], index[:MANY]
    if fallen:
        poses = _fallen_starts(template, lit.scene, points_m[index])
    else:
        poses = _upright_starts(template, lit.scene, points_m[index], yaws_deg)
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


def _upright_starts(template: Template, scene: Scene, points_m: Array, yaws_deg: Array) -> Poses:
    """Standing on the table, with the middle of its visible side over that of the points (P, 3), at each yaw (S,)."""
    if template.yaw_symmetry_deg == 0:
        yaws_deg = yaws_deg[:1]
    poses = _over(template, scene, points_m, about_z(yaws_deg))
    # The template stands on the table: what was seen of it was so high above.
    poses.origins_m[:, 2] = scene.table.level_m(points_m.mean(axis=0)) - template.bottom_m
    return poses


def _fallen_starts(template: Template, scene: Scene, points_m: Array) -> Poses:
    """Lying on the table on each of its sides, or upside down, at each yaw."""
    rotations = np.concatenate([about_z(START_YAWS_DEG[::2]) @ fall for fall in FALLS.as_matrix()])
    poses = _over(template, scene, points_m, rotations)
    lowest_m = (template.points_m @ rotations.transpose(0, 2, 1))[..., 2].min(axis=1)
    poses.origins_m[:, 2] = scene.table.level_m(points_m.mean(axis=0)) - lowest_m
    return poses


def _over(template: Template, scene: Scene, points_m: Array, rotations: Array) -> Poses:
    """With the middle of the side that the cameras see over the middle of the points."""
    middle_m = points_m.mean(axis=0)
    rays = np.array([view.eye_m - middle_m for view in scene.views])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    turned_m = template.points_m @ rotations.transpose(0, 2, 1)
    is_seen = ((template.normals @ rotations.transpose(0, 2, 1)) @ rays.T > 0.1).any(axis=2)
    is_seen[is_seen.sum(axis=1) <= FEW_SEEN] = True
    shown_m = (turned_m * is_seen[..., None]).sum(axis=1) / is_seen.sum(axis=1)[:, None]
    return Poses(rotations, middle_m - shown_m)


def _at_height(template: Template, lit: LitScene, poses: Poses) -> Poses:
    """The poses no higher or lower above the table than the object was taught, within what cloths and errors make."""
    plane = lit.scene.table.plane
    taught_m = poses.origins_m[:, :2] @ plane[:2] + plane[2] - template.bottom_m
    height_m = np.clip(poses.origins_m[:, 2], taught_m - MAX_RISE_M, taught_m + MAX_RISE_M)
    return Poses(poses.rotations, np.column_stack([poses.origins_m[:, :2], height_m]))


def _best_nearby(template: Template, lit: LitScene, index: Index, poses: Poses) -> Poses:
    """Each pose, or a better one with a yaw close by: a nearly round body keeps the yaw that its start had."""
    count = len(NEARBY_YAWS_DEG)
    rotations = (about_z(NEARBY_YAWS_DEG) @ poses.rotations[:, None]).reshape(-1, 3, 3)
    turned = Poses(rotations, np.repeat(poses.origins_m, count, axis=0))
    values = score(template, lit, index, turned, SOME).value.reshape(len(poses), count)
    return turned[np.arange(len(poses)) * count + values.argmax(axis=1)]


def registered(
    template: Template,
    poses: Poses,
    points_m: Array,
    reaches_m: Sequence[float],
    *,
    lab: Array | None = None,
    free: Sequence[int] = TURN_ABOUT_Z,
) -> Poses:
    """The poses moved so that the scene's points (P, 3) lie on the template, one step per reach.

    Args:
        reaches_m: points that are farther from the template do not count.
        lab: (P, 3) colors of the points: partners are chosen by place and color.
        free: which of (3,) rotation and (3,) translation change.
    """
    beside = POINT_TO_POINT if lab is None else POINT_TO_POINT_COLORED
    damping = np.diag([DAMPING_RAD2 if column < 3 else DAMPING_M2 for column in free])
    for reach_m in reaches_m:
        places_m = poses.to_template(points_m)
        partners = _partners(template, places_m, lab)
        offsets_m, normals = places_m - template.points_m[partners], template.normals[partners]
        weights = np.clip(1 - (offsets_m**2).sum(axis=2) / reach_m**2, 0, None) ** 2
        to_plane = np.concatenate([np.cross(places_m, normals), normals], axis=2)[..., free]
        weighted = to_plane * weights[..., None]
        lhs = weighted.transpose(0, 2, 1) @ to_plane
        rhs = np.einsum("spi,sp->si", weighted, (offsets_m * normals).sum(axis=2))
        to_point = _point_jacobian(places_m)[..., free]
        weighted = (to_point * (beside * weights)[..., None, None]).reshape(len(poses), -1, len(free))
        lhs += weighted.transpose(0, 2, 1) @ to_point.reshape(len(poses), -1, len(free)) + damping
        rhs += np.einsum("spi,sp->si", weighted, offsets_m.reshape(len(poses), -1))
        step = np.zeros((len(poses), 6))  # of the scene in the template's frame
        step[:, free] = -np.linalg.solve(lhs, rhs[..., None])[..., 0]
        turns = Rotation.from_rotvec(np.clip(step[:, :3], -MAX_TURN_RAD, MAX_TURN_RAD)).as_matrix()
        rotations = poses.rotations @ turns.transpose(0, 2, 1)
        poses = Poses(rotations, poses.origins_m - np.einsum("sij,sj->si", rotations, step[:, 3:]))
    return poses


def _partners(template: Template, places_m: Array, lab: Array | None) -> Index:
    """(S, P) index of each point's partner."""
    if lab is None:
        return template.closest(places_m)
    colored = np.concatenate([places_m, np.broadcast_to(lab * LAB_AS_M, places_m.shape)], axis=2)
    partners: Index = template.tree.query(colored.reshape(-1, 6))[1].reshape(places_m.shape[:2])
    return partners


def _point_jacobian(places_m: Array) -> Array:
    """(S, P, 3, 6) how points move with (3,) rotation and (3,) translation."""
    x, y, z = np.moveaxis(places_m, -1, 0)
    jacobian = np.zeros((*places_m.shape, 6))
    jacobian[..., 0, 1], jacobian[..., 0, 2] = z, -y
    jacobian[..., 1, 0], jacobian[..., 1, 2] = -z, x
    jacobian[..., 2, 0], jacobian[..., 2, 1] = y, -x
    jacobian[..., 3:] = np.eye(3)
    return jacobian
