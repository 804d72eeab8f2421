"""Starts, and iterative closest points of all of them at once: point to plane, a little point to point, robust."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.registered.cloud import Index
from app.perception.registered.poses import Poses, about_z
from app.perception.registered.scene import Scene
from app.perception.registered.template import LAB_AS_M, Template
from roboprompt_client.arrays import Array

MAX_RISE_M = 0.025  # from the taught height above the table: a cloth, a calibration's error
START_YAWS_DEG = np.arange(0, 360, 15.0)
MAX_TURN_RAD = 0.2  # a step
POINT_TO_POINT, POINT_TO_POINT_COLORED = 0.02, 0.06  # its weight beside point to plane: holds what could slide
DAMPING_RAD2, DAMPING_M2 = 1e-4, 1e-2
FEW_SEEN = 20  # points: with fewer, all of the template stand for its visible side
TURN_ABOUT_Z = [2, 3, 4, 5]  # upright: of (3,) rotation and (3,) translation these are free
ALL_FREE = [0, 1, 2, 3, 4, 5]
FALLS = Rotation.from_euler("xyz", [[90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0], [180, 0, 0]], degrees=True)


def upright_starts(template: Template, scene: Scene, points_m: Array, yaws_deg: Array = START_YAWS_DEG) -> Poses:
    """Standing on the table, with the middle of its visible side over that of the points (P, 3), at each yaw (S,)."""
    if template.yaw_symmetry_deg == 0:
        yaws_deg = yaws_deg[:1]
    poses = _over(template, scene, points_m, about_z(yaws_deg))
    # The template stands on the table: what was seen of it was so high above.
    poses.origins_m[:, 2] = scene.table.level_m(points_m.mean(axis=0)) - template.bottom_m
    return poses


def fallen_starts(template: Template, scene: Scene, points_m: Array) -> Poses:
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
        step = np.zeros((len(poses), 6))
        step[:, free] = -np.linalg.solve(lhs, rhs[..., None])[..., 0]
        poses = _stepped(poses, step)
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


def _stepped(poses: Poses, step: Array) -> Poses:
    """The poses after a step (S, 6) of the scene in the template's frame."""
    turns = Rotation.from_rotvec(np.clip(step[:, :3], -MAX_TURN_RAD, MAX_TURN_RAD)).as_matrix()
    rotations = poses.rotations @ turns.transpose(0, 2, 1)
    return Poses(rotations, poses.origins_m - np.einsum("sij,sj->si", rotations, step[:, 3:]))
