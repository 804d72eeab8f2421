"""Objects with a rotation symmetry: their axis, and the completion of sides that no camera saw."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from app.perception.object_model import ObjectModelError
from app.perception.registered.depth_view import VOXEL_M, Bools, Index, thinned, unit
from app.perception.registered.hypotheses import hypotheses
from app.perception.registered.icp import COARSE_M, FINAL_M, Poses, about_z, icp
from app.perception.registered.model import yaw_symmetry_deg
from app.perception.registered.scene import LitScene
from app.perception.registered.template import MAX_SPAN_M, STANDS_WITHIN_M, Template
from app.perception.registered.turns import suggested_symmetry
from roboprompt_client.types.arrays import Array

NUM_TURNS = 24  # in which a round object is completed
NUM_STEPS = 10  # of the robust least squares that find an axis
NEAR_AXIS_M = 0.01  # least distance from the axis in relative errors
OFF_AXIS_M = 0.002  # a radius that differs from those of its height by as much counts half
CURVE_NEIGHBORS, CURVE_REACH_M = 200, 0.008  # of a point on the curve of radius and height of a round object
MAX_OFF_AXIS_SHARE = 0.25  # median distance of normals from the axis, relative to the point's radius
MAX_OFF_M = 0.004  # median distance of points from the rotated template


def completed(name: str, template: Template) -> Template:
    """Return the template with its origin on its axis, its points copied to all sides of the symmetry.

    Raises:
        ObjectModelError: if it does not have its symmetry.
    """
    symmetry_deg = template.yaw_symmetry_deg
    if symmetry_deg is None:
        return template
    axis_m, problem = _axis(template, symmetry_deg)
    if problem:
        raise ObjectModelError(name, problem, 'views from more sides, or symmetric: "none"')
    template = _moved(template, np.array([*axis_m, 0.0]))
    if symmetry_deg == 0:
        template = replace(template, points_m=_on_mean_surface(template))
    turns = about_z(np.arange(0, 360, symmetry_deg or 360 / NUM_TURNS))
    points_m, rgb, normals = thinned(
        np.concatenate([template.points_m @ turn.T for turn in turns]),
        np.concatenate([template.rgb] * len(turns)),
        np.concatenate([template.normals @ turn.T for turn in turns]),
    )
    return replace(template, points_m=points_m, rgb=rgb, normals=unit(normals))


def symmetry_remedy(template: Template, turns: Sequence[float]) -> str:
    """Return what decides a yaw between such turns (degrees): another view or, if the template has one, a symmetry."""
    symmetry = suggested_symmetry(turns)
    if symmetry is None or _axis(template, yaw_symmetry_deg(symmetry) or 0.0)[1]:
        return "a further camera that tells them apart"
    value = f'"{symmetry}"' if isinstance(symmetry, str) else f"{symmetry:g}"
    return f"symmetric: {value} if these sides make no difference, or a further camera that tells them apart"


def centered(template: Template) -> Template:
    """Return the template with its origin at half its height, in its middle or on its axis."""
    middle_m = (template.points_m.min(axis=0) + template.points_m.max(axis=0)) / 2
    if template.above_table_m < STANDS_WITHIN_M:
        middle_m[2] = (template.bottom_m + template.points_m[:, 2].max()) / 2
    if template.yaw_symmetry_deg is not None:
        middle_m[:2] = 0.0
    return _moved(template, middle_m)


def _moved(template: Template, origin_m: Array) -> Template:
    """Return the template with another origin (3,), given in its frame."""
    views = []
    for view in template.free_views:
        pose = view.camera.camera_to_world.copy()
        pose[:3, 3] -= origin_m
        views.append(replace(view, camera=replace(view.camera, camera_to_world=pose)))
    points_m, bottom_m = template.points_m - origin_m, template.bottom_m - float(origin_m[2])
    return replace(template, points_m=points_m, bottom_m=bottom_m, free_views=tuple(views))


def looks_alike_turned(template: Template, lit: LitScene, index: Index, yaw_deg: float, turn_deg: float) -> bool:
    """Return whether a view, which shows the template at a yaw, fits it turned by `turn_deg` as well."""
    own, turned = (hypotheses(template, lit, index, np.array([yaw]))[0] for yaw in (yaw_deg, yaw_deg + turn_deg))
    return not own.beats(turned)


def _axis(template: Template, symmetry_deg: float) -> tuple[Array, str]:
    """Return the axis (2,) of a symmetry, and why the template does not have it (empty if it has)."""
    axis_m, problem = _round_axis(template) if symmetry_deg == 0 else _turn_axis(template, symmetry_deg)
    reach_m = float(np.linalg.norm(template.points_m[:, :2] - axis_m, axis=1).max())
    if not problem and 2 * reach_m > MAX_SPAN_M:  # of a nearly flat side: all around its axis it would fill the memory
        problem = f"would be {200 * reach_m:.0f} cm wide around its axis, at most {100 * MAX_SPAN_M:.0f}"
    return axis_m, problem


def _round_axis(template: Template) -> tuple[Array, str]:
    """Return the vertical axis (2,) of a round body, and why the template is not round (empty if it is)."""
    level = np.linalg.norm(template.normals[:, :2], axis=1)
    is_wall = level > 0.3
    points_m, normals = template.points_m[is_wall], template.normals[is_wall, :2] / level[is_wall, None]
    if len(points_m) < 10:
        return np.zeros(2), f"only {len(points_m)} of its points are on an upright wall: too few to find its axis"
    sideways = np.column_stack([normals[:, 1], -normals[:, 0]])
    along_m = (sideways * points_m[:, :2]).sum(axis=1)
    axis_m = np.asarray(np.linalg.lstsq(sideways, along_m, rcond=None)[0], np.float64)  # which all normals meet
    weights = np.ones(len(points_m))
    for _ in range(NUM_STEPS):
        axis_m, weights = _equal_radii(points_m, normals, axis_m, weights)
    off_m, radii_m = np.abs(sideways @ axis_m - along_m), np.linalg.norm(points_m[:, :2] - axis_m, axis=1)
    share = float(np.median(off_m / np.maximum(radii_m, NEAR_AXIS_M)))
    problem = f"is not round: half of its walls face past the axis by {100 * share:.0f} % of their distance"
    return axis_m, problem if share > MAX_OFF_AXIS_SHARE else ""


def _equal_radii(points_m: Array, normals: Array, axis_m: Array, weights: Array) -> tuple[Array, Array]:
    """Return the axis (2,) after one step towards equal radii of wall points, and the points' new weights (N,).

    Points of one height on one side of the wall have the same radius, whichever it is: only deviations from its mean
    count (weighted least squares). Normals alone err where a wall is thin, since neighbors lie on both of its sides.

    Args:
        points_m, normals: (N, 3) and (N, 2) of the wall.
    """
    radii_m, outward, faces_out = _about_axis(points_m[:, :2] - axis_m, normals)
    _, ring = np.unique(2 * np.floor(points_m[:, 2] / VOXEL_M).astype(int) + faces_out, return_inverse=True)
    values = np.column_stack([radii_m, outward])
    sums = np.stack([np.bincount(ring, weights * value) for value in values.T], axis=1)
    deviations = values - (sums / np.bincount(ring, weights)[:, None])[ring]
    roots = np.sqrt(weights)[:, None]
    step_m, *_ = np.linalg.lstsq(roots * deviations[:, 1:], roots[:, 0] * deviations[:, 0], rcond=None)
    residuals_m = deviations[:, 0] - deviations[:, 1:] @ step_m
    return axis_m + step_m, 1 / (1 + (residuals_m / OFF_AXIS_M) ** 2)


def _on_mean_surface(template: Template) -> Array:
    """Return the points (N, 3) of a round template, its axis at the origin, each moved onto the mean surface around it.

    Depth noise makes a wall several millimeters thick, and a scene's points fit anywhere within it. All points of one
    height say where the surface is: a curve of radius and height, on each side of the wall.
    """
    radii_m, outward, faces_out = _about_axis(template.points_m[:, :2], template.normals[:, :2])
    curve_m = np.column_stack([radii_m, template.points_m[:, 2]])
    for side in (faces_out, ~faces_out):
        if side.any():
            curve_m[side] = _onto_lines(curve_m[side])
    return np.column_stack([outward * curve_m[:, :1], curve_m[:, 1]])


def _about_axis(offsets_m: Array, normals: Array) -> tuple[Array, Array, Bools]:
    """Return radii (N,), directions (N, 2) of level offsets (N, 2) from an axis; whether normals (N, 2) point away."""
    radii_m = np.linalg.norm(offsets_m, axis=1)
    outward = unit(offsets_m)
    return radii_m, outward, (normals * outward).sum(axis=1) > 0


def _onto_lines(places_m: Array) -> Array:
    """Return places (N, 2), each moved onto the line that fits its neighbors best."""
    _, index = cKDTree(places_m).query(places_m, k=CURVE_NEIGHBORS, distance_upper_bound=CURVE_REACH_M)
    known = (index < len(places_m))[..., None]
    near_m = places_m[np.minimum(index, len(places_m) - 1)]
    mean_m = np.where(known, near_m, 0).sum(axis=1) / known.sum(axis=1)
    offsets_m = np.where(known, near_m - mean_m[:, None], 0)
    across = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets_m, offsets_m))[1][:, :, 0]
    onto: Array = places_m - ((places_m - mean_m) * across).sum(axis=1, keepdims=True) * across
    return onto


def _turn_axis(template: Template, symmetry_deg: float) -> tuple[Array, str]:
    """Return the axis (2,) of a rotation that maps the template onto itself, and why there is none (or empty)."""
    middle_m = template.points_m.mean(axis=0)
    turn = about_z(symmetry_deg)
    start = Poses(turn, (middle_m - turn[0] @ middle_m)[None])
    pose = icp(template, start, template.points_m, (*COARSE_M, *FINAL_M), lab=template.lab)
    axis_m = np.asarray(np.linalg.solve(np.eye(2) - pose.rotations[0, :2, :2], pose.origins_m[0, :2]), np.float64)
    off_mm = 1000 * float(np.median(template.distance_m(pose.to_template(template.points_m)[0])))
    problem = f"differs from itself turned by {symmetry_deg:g} degrees: by {off_mm:.0f} mm in the median"
    return axis_m, problem if off_mm > 1000 * MAX_OFF_M else ""
