"""The score of a pose, in both directions: template points in the scene's images, scene points in the template.

The evidence of a point is a number in -1..1: positive if place and color agree; negative if the camera sees through the
point, or another color; 0 if nothing is known.
"""

from dataclasses import dataclass

import numpy as np

from app.perception.registered.depth_view import VOXEL_M, Bools, Index, lengths
from app.perception.registered.icp import Poses
from app.perception.registered.scene import LIGHTNESS, LitScene
from app.perception.registered.template import Template
from roboprompt_client.types.arrays import Array

NEAR_M = 0.009  # tolerance of agreement in depth
BEHIND_M = 0.013  # the camera sees through a point if its depth is farther by this
SAME_LAB = 24.0  # of one color, in Lab units
OTHER_COLOR = -0.7  # evidence of another color at the right place
ALONG_SURFACE = 0.3  # weight of an offset along the surface, relative to one across it
BESIDE_M = 0.05  # a point farther from the template belongs to another object
UNSEEN = 0.3  # penalty of an unexplained point of the scene
# Colors of one object differ from the taught ones by shading, which is another one on each side and changes lightness
# and chroma together. A median beyond these is that of another object of the same shape.
SAME_LIGHTNESS, SAME_CHROMA = 0.28, 8.0  # a ratio of lightness, as its logarithm; Lab units at middle lightness
DARK, MIDDLE = 16.0, 66.0  # Lab units: lightness plus `DARK`, a and b grow alike with the light
FEWEST_COLORS = 10  # points
FACING = 0.2  # least cosine between a surface's normal and the ray to a camera that sees it


@dataclass(frozen=True, eq=False)
class Score:
    """Scores of S poses.

    Attributes:
        value: (S,) 0..1, the share of agreeing evidence, of both directions.
        support: (S,) 0..1, the share of the template's visible side that is found.
        evidence: (S, E) of each point, see above.
    """

    value: Array
    support: Array
    evidence: Array


def score(template: Template, lit: LitScene, index: Index, poses: Poses, num_points: int) -> Score:
    """Return the scores of poses for the points `index` of a scene.

    Args:
        num_points: number of template points to compare with the images.
    """
    chosen = np.random.default_rng(0).permutation(len(template))[:num_points]
    of_template, faces = np.zeros((len(poses), len(chosen))), np.zeros((len(poses), len(chosen)), bool)
    for number in range(len(lit.scene.views)):  # the strongest evidence of any camera counts
        one, faces_one = _in_image(template, chosen, lit, number, poses)
        of_template = np.where(np.abs(one) > np.abs(of_template), one, of_template)
        faces |= faces_one
    support = np.maximum(of_template, 0).sum(axis=1) / np.maximum(faces.sum(axis=1), 1)
    of_scene, is_unexplained = _in_template(template, lit.scene.points_m[index], lit.lab[index], poses)
    # Both directions have the same weight, whatever their numbers of points.
    share = np.minimum(1, len(index) / np.maximum((of_template != 0).sum(axis=1), 1))
    evidence = np.concatenate([of_template * share[:, None], of_scene], axis=1)
    good = np.maximum(evidence, 0).sum(axis=1)
    bad = UNSEEN * is_unexplained.sum(axis=1) - np.minimum(evidence, 0).sum(axis=1)
    return Score(good / np.maximum(good + bad, 1), support, evidence)


def same_color(template: Template, lit: LitScene, index: Index, pose: Poses) -> float:
    """Return 1 if the points `index` that lie on the object in one pose have its colors in the median, less if not."""
    places_m = pose.to_template(lit.scene.points_m[index])[0]
    partners = template.closest(places_m)
    near = np.linalg.norm(places_m - template.points_m[partners], axis=1) < NEAR_M
    if near.sum() < FEWEST_COLORS:
        return 1.0
    seen, taught = lit.lab[index[near]], template.lab[partners[near]]
    bright, taught_bright = (lab[:, :1] / LIGHTNESS + DARK for lab in (seen, taught))
    lightness = abs(float(np.median(np.log(bright / taught_bright))))
    chroma = MIDDLE * float(np.linalg.norm(np.median(seen[:, 1:] / bright - taught[:, 1:] / taught_bright, axis=0)))
    return float(np.clip(2 - max(lightness / SAME_LIGHTNESS, chroma / SAME_CHROMA), 0, 1))


def shares_seen(template: Template, lit: LitScene, poses: Poses) -> dict[str, float]:
    """Return for each camera which share of the side that faces it agrees with its image; `poses` has one pose."""
    shares = {}
    for number, view in enumerate(lit.scene.views):
        one, faces = _in_image(template, np.arange(len(template)), lit, number, poses)
        shares[view.camera.name] = float(np.maximum(one, 0).sum() / max(faces.sum(), 1))
    return shares


def _in_image(template: Template, chosen: Index, lit: LitScene, number: int, poses: Poses) -> tuple[Array, Bools]:
    """Return the evidence (S, P) of one camera on the template's points, and whether these face it."""
    view = lit.scene.views[number]
    world_m = poses.to_world(template.points_m[chosen])
    normals = template.normals[chosen] @ poses.rotations.transpose(0, 2, 1)
    rays_m = view.eye_m - world_m
    faces = np.einsum("spi,spi->sp", normals, rays_m) > FACING * lengths(rays_m)
    seen = view.look_up(world_m[faces])
    off_m = seen.depth_m - seen.point_m
    is_there = (np.abs(off_m) < NEAR_M) & (seen.depth_m > 0)
    colors, taught = lit.lab_at(number, seen.rows, seen.columns), template.lab[chosen[np.nonzero(faces)[1]]]
    agreement = _agreement(off_m / NEAR_M, lengths(colors - taught) / SAME_LAB)
    evidence = np.zeros(faces.shape)
    evidence[faces] = np.where(seen.nearest_m > seen.point_m + BEHIND_M, -1.0, np.where(is_there, agreement, 0))
    return evidence, faces


def _in_template(template: Template, points_m: Array, lab: Array, poses: Poses) -> tuple[Array, Bools]:
    """Return the evidence (S, P) of the template on the scene's points, and whether these are close but unexplained."""
    places_m = poses.to_template(points_m)
    partners = template.closest(places_m)
    offsets_m = places_m - template.points_m[partners]
    across_m = np.abs(np.einsum("spi,spi->sp", offsets_m, template.normals[partners]))
    distance_m = lengths(offsets_m)
    off_m = across_m + ALONG_SURFACE * np.maximum(distance_m - VOXEL_M, 0)
    is_near = distance_m < NEAR_M
    is_free = np.zeros(is_near.shape, bool)
    for view in template.free_views:
        open_ = ~(is_near | is_free)
        seen = view.look_up(places_m[open_])
        is_free[open_] = seen.nearest_m > seen.point_m + BEHIND_M
    hue = lengths(lab - template.lab[partners]) / SAME_LAB
    evidence = np.where(is_near, _agreement(off_m / NEAR_M, hue), np.where(is_free, -1.0, 0.0))
    return evidence, ~is_near & ~is_free & (distance_m < BESIDE_M)


def _agreement(off: Array, hue: Array) -> Array:
    """Return 1 for equal place and color, down to 0.25 at their tolerances; `OTHER_COLOR` beyond that of color."""
    agreement: Array = np.where(hue < 1, 1 - 0.5 * np.minimum(off**2, 1) - 0.25 * hue**2, OTHER_COLOR)
    return agreement
