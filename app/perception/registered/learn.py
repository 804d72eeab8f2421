"""Labeled views of an object -> a template.

The view with most points begins; each further one is registered to what is there and adds its points, if it fits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.perception.object_model import ObjectModelError
from app.perception.registered.decide import MIN_SCORE, yaw_rivals
from app.perception.registered.geometry import Index, thinned, unit
from app.perception.registered.hypotheses import START_YAWS_DEG, Hypothesis, hypotheses
from app.perception.registered.scene import Scene
from app.perception.registered.score import NEAR_M
from app.perception.registered.symmetry import centered, completed, looks_alike_all_around, looks_alike_turned
from app.perception.registered.template import Template
from app.perception.registered.view import free_views
from roboprompt_client.types.camera import RgbdFrame

FEWEST_POINTS = 40
FREE_MARGIN_M = 0.06  # around the object, within which its views say what is free
MAX_SPAN_M = 0.7
ARROW_ERROR_DEG = np.array([-10.0, -3, 3, 10])  # of arrows that people draw
MAX_ROOTS = 2  # views that are tried as the first
HELP_LABEL = "a mask that holds all of it and nothing else, in every camera that sees it"


@dataclass(frozen=True, eq=False)
class LabeledView:
    """One observation in which an object is labeled.

    Attributes:
        frames: with color, depth and the object's mask: what is not 0 is the object.
        yaw_deg: of its x axis about the vertical, to within ten degrees, or None.
    """

    frames: tuple[RgbdFrame, ...]
    yaw_deg: float | None = None


@dataclass(frozen=True, eq=False)
class Learned:
    """A template, and what became of each view.

    Attributes:
        merged: numbers of the views, the first of them first.
        refused: by number of the view, why it was not merged.
    """

    template: Template
    merged: tuple[int, ...]
    refused: Mapping[int, str]


@dataclass(frozen=True, eq=False)
class _Seen:
    scene: Scene
    index: Index
    yaw_deg: float | None


def learn(name: str, views: Sequence[LabeledView], symmetry_deg: float | None, *, needs_yaw: bool = True) -> Learned:
    """A template of the object `name`.

    Args:
        symmetry_deg: the turn about the vertical that leaves it unchanged: 0 any, None none.
        needs_yaw: refuse an object whose yaw could never be known.

    Raises:
        ObjectModelError: if no view shows the object, none of several fits another, or it is not as symmetric as said.
        InvalidInputError: if images are unusable.
    """
    seen: dict[int, _Seen] = {}
    refused: dict[int, str] = {}
    for number, view in enumerate(views):
        scene = Scene.of(view.frames)
        index = labeled_points(scene)
        if problem := _problem(scene, index):
            refused[number] = problem
        else:
            seen[number] = _Seen(scene, index, view.yaw_deg)
    if not seen:
        reasons = "; ".join(f"view {number}: {reason}" for number, reason in refused.items())
        raise ObjectModelError(name, f"no view shows it: {reasons or 'there is none'}", HELP_LABEL)
    roots = sorted(seen, key=lambda number: -len(seen[number].index))[:MAX_ROOTS]
    # Arrows merge views of single sides, from which the axis of a symmetry is not known yet.
    has_arrows = all(item.yaw_deg is not None for item in seen.values())
    merged_deg = None if has_arrows and symmetry_deg else symmetry_deg
    best = max((_grown(name, seen, root, merged_deg) for root in roots), key=lambda item: len(item.merged))
    if len(views) > 1 and len(best.merged) == 1:
        reasons = "; ".join(f"view {number}: {reason}" for number, reason in {**best.refused, **refused}.items())
        remedy = "views that show the same side, with a yaw each; the object rigid and upright in all of them"
        raise ObjectModelError(name, f"none of the {len(views)} views fits another: {reasons}", remedy)
    root = seen[best.merged[0]]
    if merged_deg != symmetry_deg:
        best = replace(best, template=completed(name, replace(best.template, yaw_symmetry_deg=symmetry_deg)))
    if symmetry_deg and not _look_alike_turned([seen[number] for number in best.merged], symmetry_deg):
        message = f"turned by {symmetry_deg:g} degrees it looks otherwise"
        raise ObjectModelError(name, message, 'symmetric: "none"')
    lit = root.scene.in_light_of(best.template.table_rgb)
    if symmetry_deg is None and needs_yaw and looks_alike_all_around(best.template, lit, root.index):
        remedy = 'symmetric: "yaw"; or views of the side that tells its yaws apart'
        raise ObjectModelError(name, "looks the same at every yaw, as far as it was seen", remedy)
    return replace(best, template=centered(best.template), refused={**best.refused, **refused})


def _look_alike_turned(views: Sequence[_Seen], symmetry_deg: float) -> bool:
    """Whether most views fit the first one turned. Its own noise fits it unturned: that it does not, says nothing."""
    template = _first(views[0], None)
    yaws_deg = [views[0].yaw_deg or 0.0, *(_found(template, view, views[0])[0].yaw_deg for view in views[1:])]
    first, *others = (
        looks_alike_turned(template, view.scene.in_light_of(template.table_rgb), view.index, yaw_deg, symmetry_deg)
        for view, yaw_deg in zip(views, yaws_deg, strict=True)
    )
    votes = [first, *others] if first else others
    return sum(votes) > len(votes) / 2


def labeled_points(scene: Scene) -> Index:
    """Index of the scene's points that a camera sees within the mask."""
    inside = np.zeros(len(scene.points_m), bool)
    for view in scene.views:
        if view.mask is not None:
            seen = view.look_up(scene.points_m)
            inside |= view.mask[seen.rows, seen.columns] & (np.abs(seen.depth_m - seen.point_m) < NEAR_M)
    return np.flatnonzero(inside)


def _problem(scene: Scene, index: Index) -> str:
    """Why a view cannot teach; empty if it can."""
    if len(index) < FEWEST_POINTS:
        known = f"its masks hold {len(index)} points above the table with known depth"
        return f"{known}, at least {FEWEST_POINTS} are needed"
    span_m = float(np.ptp(scene.points_m[index], axis=0).max())
    return f"its masks span {100 * span_m:.0f} cm, at most {100 * MAX_SPAN_M:.0f}" if span_m > MAX_SPAN_M else ""


def _grown(name: str, seen: Mapping[int, _Seen], root: int, symmetry_deg: float | None) -> Learned:
    """The template that begins with a view, with all others that fit it."""
    template = completed(name, _first(seen[root], symmetry_deg))
    merged, refused = [root], dict[int, str]()
    for number in [number for number in seen if number != root] * 2:  # what does not fit yet may fit later
        if number in merged:
            continue
        outcome = _with(template, seen[number], seen[root])
        if isinstance(outcome, str):
            refused[number] = outcome
        else:
            template = completed(name, outcome)
            merged.append(number)
            refused.pop(number, None)
    return Learned(template, tuple(merged), refused)


def _first(seen: _Seen, symmetry_deg: float | None) -> Template:
    """The template of one view; its x axis is the arrow's."""
    scene, points_m = seen.scene, seen.scene.points_m[seen.index]
    pose = np.eye(4)
    yaw = np.radians(seen.yaw_deg or 0.0)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:2, 3] = (points_m[:, :2].min(axis=0) + points_m[:, :2].max(axis=0)) / 2
    pose[2, 3] = scene.table.level_m(pose[:3, 3])
    local_m = (points_m - pose[:3, 3]) @ pose[:3, :3]
    free = tuple(free_views(scene.views, pose, local_m, FREE_MARGIN_M))
    normals = scene.normals[seen.index] @ pose[:3, :3]
    return Template(local_m, normals, scene.rgb[seen.index], free, scene.table.rgb, 0.0, (), symmetry_deg)


def _found(template: Template, seen: _Seen, root: _Seen) -> Sequence[Hypothesis]:
    """The poses that a view allows the template, whose yaw was that of the root's arrow; the best first."""
    has_arrows = seen.yaw_deg is not None and root.yaw_deg is not None
    yaws_deg = seen.yaw_deg + ARROW_ERROR_DEG if has_arrows else START_YAWS_DEG
    return hypotheses(template, seen.scene.in_light_of(template.table_rgb), seen.index, yaws_deg)


def _with(template: Template, seen: _Seen, root: _Seen) -> Template | str:
    """The template with a view's points, or why the view does not fit."""
    found = _found(template, seen, root)
    if found[0].value < MIN_SCORE:
        return f"it agrees with the others to {found[0].value:.2f}, at least {MIN_SCORE:.2f} is needed"
    if (seen.yaw_deg is None or root.yaw_deg is None) and (rivals := yaw_rivals(template, found)):
        return f"{len(rivals) + 1} yaws fit the other views: a yaw with each label would decide"
    scene, index, pose = seen.scene, seen.index, found[0].template_to_world
    gain = template.table_rgb / np.maximum(scene.table.rgb, 1)
    local_m = (scene.points_m[index] - pose[:3, 3]) @ pose[:3, :3]
    points_m, rgb, normals = thinned(
        np.concatenate([template.points_m, local_m]),
        np.concatenate([template.rgb, np.clip(scene.rgb[index] * gain, 0, 255)]),
        np.concatenate([template.normals, scene.normals[index] @ pose[:3, :3]]),
    )
    free = (*template.free_views, *free_views(scene.views, pose, points_m, FREE_MARGIN_M))
    scores = (*template.scores, found[0].value)
    return replace(template, points_m=points_m, normals=unit(normals), rgb=rgb, free_views=free, scores=scores)
