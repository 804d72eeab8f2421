"""Objects that a turn leaves unchanged: their axis, and their unseen sides from those that were seen."""

from dataclasses import replace

import numpy as np

from app.perception.object_model import ObjectModelError
from app.perception.registered.decide import yaw_rivals
from app.perception.registered.geometry import Index, Poses, about_z, thinned, unit
from app.perception.registered.hypotheses import COARSE_M, FINAL_M, hypotheses, registered
from app.perception.registered.scene import LitScene
from app.perception.registered.template import STANDS_WITHIN_M, Template
from roboprompt_client.types.arrays import Array

NUM_TURNS = 24  # in which a round object is completed
NUM_STEPS = 10  # of the robust fit of an axis
NEAR_AXIS_M = 0.01  # nearer to the axis, distances do not count
OFF_AXIS_M = 0.002  # a normal that passes the axis so far off counts half
MAX_OFF_AXIS_SHARE = 0.25  # of its distance, in the median, by which a normal misses the axis of a round object
MAX_OFF_M = 0.004  # a point from its like on the other side, in the median
ALL_AROUND, MAX_GAP_DEG = 6, 120.0  # yaws that look alike, and the largest gap between them


def completed(name: str, template: Template) -> Template:
    """The template with its axis as origin's, and with its sides as its symmetry makes them.

    Raises:
        ObjectModelError: if it is not as symmetric as said.
    """
    symmetry_deg = template.yaw_symmetry_deg
    if symmetry_deg is None:
        return template
    axis_m, problem = _round_axis(template) if symmetry_deg == 0 else _turn_axis(template, symmetry_deg)
    if problem:
        raise ObjectModelError(name, problem, 'views from more sides, or symmetric: "none"')
    template = _moved(template, np.array([*axis_m, 0.0]))
    turns = about_z(np.arange(0, 360, symmetry_deg or 360 / NUM_TURNS))
    points_m, rgb, normals = thinned(
        np.concatenate([template.points_m @ turn.T for turn in turns]),
        np.concatenate([template.rgb] * len(turns)),
        np.concatenate([template.normals @ turn.T for turn in turns]),
    )
    return replace(template, points_m=points_m, rgb=rgb, normals=unit(normals))


def centered(template: Template) -> Template:
    """The template with its origin at half its height; in its middle, unless it has an axis."""
    middle_m = (template.points_m.min(axis=0) + template.points_m.max(axis=0)) / 2
    if template.above_table_m < STANDS_WITHIN_M:
        middle_m[2] = (template.bottom_m + template.points_m[:, 2].max()) / 2
    if template.yaw_symmetry_deg is not None:
        middle_m[:2] = 0.0
    return _moved(template, middle_m)


def _moved(template: Template, origin_m: Array) -> Template:
    """The template with another origin (3,), given in its frame."""
    views = []
    for view in template.free_views:
        pose = view.camera.camera_to_world.copy()
        pose[:3, 3] -= origin_m
        views.append(replace(view, camera=replace(view.camera, camera_to_world=pose)))
    points_m, bottom_m = template.points_m - origin_m, template.bottom_m - float(origin_m[2])
    return replace(template, points_m=points_m, bottom_m=bottom_m, free_views=tuple(views))


def looks_alike_all_around(template: Template, lit: LitScene, index: Index) -> bool:
    """Whether a view from which the template was learned fits it at every yaw."""
    found = hypotheses(template, lit, index)
    yaws = np.sort([item.yaw_deg for item in (found[0], *yaw_rivals(template, found))])
    gaps = np.diff(yaws, append=yaws[0] + 360)
    return len(yaws) >= ALL_AROUND and bool(gaps.max() < MAX_GAP_DEG)


def looks_alike_turned(template: Template, lit: LitScene, index: Index, yaw_deg: float, turn_deg: float) -> bool:
    """Whether the view from which a template was learned, there at a yaw, fits it turned by so much as well."""
    own, turned = (hypotheses(template, lit, index, np.array([yaw]))[0] for yaw in (yaw_deg, yaw_deg + turn_deg))
    return not own.beats(turned)


def _round_axis(template: Template) -> tuple[Array, str]:
    """(2,) where the vertical axis is that the normals of a round body meet, and why it is not round, if it is not."""
    level = np.linalg.norm(template.normals[:, :2], axis=1)
    is_wall = level > 0.3
    places_m, across = template.points_m[is_wall, :2], template.normals[is_wall, :2] / level[is_wall, None]
    sideways = np.column_stack([across[:, 1], -across[:, 0]])
    target_m = (sideways * places_m).sum(axis=1)
    weights = np.ones(len(target_m))
    axis_m: Array = np.zeros(2)
    if len(target_m) < 10:
        return axis_m, f"only {len(target_m)} of its points are on an upright wall: too few to find its axis"
    for _ in range(NUM_STEPS):
        axis_m[:] = np.linalg.lstsq(sideways * weights[:, None], target_m * weights, rcond=None)[0]
        weights = 1 / (1 + ((sideways @ axis_m - target_m) / OFF_AXIS_M) ** 2)
    off = np.abs(sideways @ axis_m - target_m) / np.maximum(np.linalg.norm(places_m - axis_m, axis=1), NEAR_AXIS_M)
    share = float(np.median(off))
    problem = f"is not round: half of its walls face past the axis by {100 * share:.0f} % of their distance"
    return axis_m, problem if share > MAX_OFF_AXIS_SHARE else ""


def _turn_axis(template: Template, symmetry_deg: float) -> tuple[Array, str]:
    """(2,) the axis about which a turn brings the template onto itself, and why none does, if none does."""
    middle_m = template.points_m.mean(axis=0)
    turn = about_z(symmetry_deg)
    start = Poses(turn, (middle_m - turn[0] @ middle_m)[None])
    pose = registered(template, start, template.points_m, (*COARSE_M, *FINAL_M), lab=template.lab)
    axis_m = np.asarray(np.linalg.solve(np.eye(2) - pose.rotations[0, :2, :2], pose.origins_m[0, :2]), np.float64)
    off_mm = 1000 * float(np.median(template.distance_m(pose.to_template(template.points_m)[0])))
    problem = f"differs from itself turned by {symmetry_deg:g} degrees: by {off_mm:.0f} mm in the median"
    return axis_m, problem if off_mm > 1000 * MAX_OFF_M else ""
