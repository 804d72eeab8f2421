"""What the scene says of a pose, both ways: the template in the scene's images, the scene's points in the template's.

Evidence is one number in -1..1 for a point: it agrees in place and color; it is seen through, or has another color; 0
where nothing is known.
"""

from dataclasses import dataclass

import numpy as np

from app.perception.registered.geometry import VOXEL_M, Bools, Index, Poses
from app.perception.registered.scene import LitScene
from app.perception.registered.template import Template
from roboprompt_client.types.arrays import Array

NEAR_M = 0.009  # agrees with a depth
BEHIND_M = 0.013  # farther than a point by this much: the point is seen through
SAME_LAB = 24.0  # of one color, in Lab units
OTHER_COLOR = -0.7  # the evidence of another color in the right place
ALONG_SURFACE = 0.3  # how much an offset along the surface counts beside one across it
BESIDE_M = 0.05  # a point that is farther from the template belongs to something else
UNSEEN = 0.3  # how much a point of the scene counts against a pose that leaves it unexplained
FACING = 0.2  # least cosine between a surface's normal and the ray to a camera that sees it


@dataclass(frozen=True, eq=False)
class Score:
    """Of S poses.

    Attributes:
        value: (S,) 0..1, the share of what both sides see of each other that agrees.
        support: (S,) 0..1, the share of the template's visible side that is found.
        evidence: (S, E), see above.
    """

    value: Array
    support: Array
    evidence: Array


def score(template: Template, lit: LitScene, index: Index, poses: Poses, num_points: int) -> Score:
    """How well poses explain the points `index` of a scene.

    Args:
        num_points: of the template, that are looked for in the images.
    """
    chosen = np.random.default_rng(0).permutation(len(template))[:num_points]
    of_template, faces = np.zeros((len(poses), len(chosen))), np.zeros((len(poses), len(chosen)), bool)
    for number in range(len(lit.scene.views)):  # the strongest evidence of any camera counts
        one, faces_one = _in_image(template, chosen, lit, number, poses)
        of_template = np.where(np.abs(one) > np.abs(of_template), one, of_template)
        faces |= faces_one
    support = np.maximum(of_template, 0).sum(axis=1) / np.maximum(faces.sum(axis=1), 1)
    of_scene, is_unexplained = _in_template(template, lit.scene.points_m[index], lit.lab[index], poses)
    # Both sides count alike, however many points either has.
    share = np.minimum(1, len(index) / np.maximum((of_template != 0).sum(axis=1), 1))
    evidence = np.concatenate([of_template * share[:, None], of_scene], axis=1)
    good = np.maximum(evidence, 0).sum(axis=1)
    bad = UNSEEN * is_unexplained.sum(axis=1) - np.minimum(evidence, 0).sum(axis=1)
    return Score(good / np.maximum(good + bad, 1), support, evidence)


def shares_seen(template: Template, lit: LitScene, poses: Poses) -> dict[str, float]:
    """By camera the share of the side which faces it that it sees where the one pose puts it."""
    shares = {}
    for number, view in enumerate(lit.scene.views):
        one, faces = _in_image(template, np.arange(len(template)), lit, number, poses)
        shares[view.camera.name] = float(np.maximum(one, 0).sum() / max(faces.sum(), 1))
    return shares


def _in_image(template: Template, chosen: Index, lit: LitScene, number: int, poses: Poses) -> tuple[Array, Bools]:
    """(S, P) what one camera says of the template's points, and whether they face it."""
    view = lit.scene.views[number]
    world_m = poses.to_world(template.points_m[chosen])
    normals = template.normals[chosen] @ poses.rotations.transpose(0, 2, 1)
    rays_m = view.eye_m - world_m
    faces = (normals * rays_m).sum(axis=2) > FACING * np.linalg.norm(rays_m, axis=2)
    seen = view.look_up(world_m)
    off_m = seen.depth_m - seen.point_m
    is_there = (np.abs(off_m) < NEAR_M) & (seen.depth_m > 0)
    colors = lit.lab_at(number, seen.rows, seen.columns)
    hue = np.linalg.norm(colors - template.lab[chosen], axis=2) / SAME_LAB
    evidence = np.where(is_there, _agreement(off_m / NEAR_M, hue), 0)
    evidence = np.where(seen.nearest_m > seen.point_m + BEHIND_M, -1.0, evidence)
    return np.where(faces, evidence, 0), faces


def _in_template(template: Template, points_m: Array, lab: Array, poses: Poses) -> tuple[Array, Bools]:
    """(S, P) what the template says of the scene's points, and whether it does not know of anything close by."""
    places_m = poses.to_template(points_m)
    partners = template.closest(places_m)
    offsets_m = places_m - template.points_m[partners]
    across_m = np.abs((offsets_m * template.normals[partners]).sum(axis=2))
    distance_m = np.linalg.norm(offsets_m, axis=2)
    off_m = across_m + ALONG_SURFACE * np.maximum(distance_m - VOXEL_M, 0)
    is_near = distance_m < NEAR_M
    is_free = np.zeros(is_near.shape, bool)
    for view in template.free_views:
        seen = view.look_up(places_m)
        is_free |= seen.nearest_m > seen.point_m + BEHIND_M
    hue = np.linalg.norm(lab - template.lab[partners], axis=2) / SAME_LAB
    evidence = np.where(is_near, _agreement(off_m / NEAR_M, hue), np.where(is_free, -1.0, 0.0))
    return evidence, ~is_near & ~is_free & (distance_m < BESIDE_M)


def _agreement(off: Array, hue: Array) -> Array:
    """1 for the same place and color, 0.25 at the edge of the same, less than 0 for another color there."""
    agreement: Array = np.where(hue < 1, 1 - 0.5 * np.minimum(off**2, 1) - 0.25 * hue**2, OTHER_COLOR)
    return agreement
