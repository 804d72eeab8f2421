"""From labeled views of an object to a template.

The template starts as the view with most points; each further view is registered to it and adds its points if it fits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.perception.object_model import ObjectModelError
from app.perception.registered.decide import MIN_SCORE
from app.perception.registered.depth_view import Index, free_views, thinned, unit
from app.perception.registered.hypotheses import START_YAWS_DEG, Hypothesis, hypotheses
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.symmetry import centered, completed, looks_alike_turned, symmetry_remedy
from app.perception.registered.template import MAX_SPAN_M, Template
from app.perception.registered.turns import in_words, turns_deg, yaw_rivals
from roboprompt_client.types.camera import RgbdFrame

FEWEST_POINTS = 40
FREE_MARGIN_M = 0.06  # margin around the object in the stored free-space images
ARROW_ERROR_DEG = np.array([-10.0, -3, 3, 10])  # starting yaws around an arrow drawn by hand
MAX_ROOTS = 2  # views that are tried as the start
HELP_LABEL = "a mask that holds all of it and nothing else, in every camera that sees it"


@dataclass(frozen=True, eq=False)
class LabeledView:
    """One observation in which an object is labeled.

    Attributes:
        frames: with color, depth and the object's mask (not 0: the object).
        yaw_deg: yaw of its x axis to within ten degrees, or None.
    """

    frames: tuple[RgbdFrame, ...]
    yaw_deg: float | None = None


@dataclass(frozen=True, eq=False)
class Learned:
    """A template, and which views it contains.

    Attributes:
        merged: numbers of the merged views, in order.
        refused: for each other view, by number, why it was not merged.
    """

    template: Template
    merged: tuple[int, ...]
    refused: Mapping[int, str]


@dataclass(frozen=True, eq=False)
class _LabeledPoints:
    scene: Scene
    index: Index
    yaw_deg: float | None


def learn(name: str, views: Sequence[LabeledView], symmetry_deg: float | None, *, needs_yaw: bool = True) -> Learned:
    """Return a template of the object `name`.

    Args:
        symmetry_deg: the rotation symmetry about the vertical: 0 round, None none.
        needs_yaw: refuse an object whose yaw cannot be determined.

    Raises:
        ObjectModelError: if no view shows the object, no two views fit each other, or the symmetry is wrong.
        InvalidInputError: if images are unusable.
    """
    usable, refused = _usable(name, views)
    learned = _merged(name, usable, symmetry_deg)
    refused = {**learned.refused, **refused}
    if len(views) > 1 and len(learned.merged) == 1:
        remedy = "views that show the same side, with a yaw each; the object rigid and upright in all of them"
        raise ObjectModelError(name, f"none of the {len(views)} views fits another: {_listed(refused)}", remedy)
    _check_symmetry(name, learned.template, [usable[number] for number in learned.merged], needs_yaw=needs_yaw)
    return replace(learned, template=centered(learned.template), refused=refused)


def _usable(name: str, views: Sequence[LabeledView]) -> tuple[dict[int, _LabeledPoints], dict[int, str]]:
    """Return the labeled points of the views that have enough, by number, and why each other view is unusable."""
    usable, refused = dict[int, _LabeledPoints](), dict[int, str]()
    for number, view in enumerate(views):
        scene = Scene.of(view.frames)
        index = np.flatnonzero(scene.masked())
        if problem := _problem(scene, index):
            refused[number] = problem
        else:
            usable[number] = _LabeledPoints(scene, index, view.yaw_deg)
    if not usable:
        raise ObjectModelError(name, f"no view shows it: {_listed(refused) or 'there is none'}", HELP_LABEL)
    return usable, refused


def _listed(refused: Mapping[int, str]) -> str:
    return "; ".join(f"view {number}: {reason}" for number, reason in refused.items())


def _merged(name: str, usable: Mapping[int, _LabeledPoints], symmetry_deg: float | None) -> Learned:
    """Return the template of most views, complete under its symmetry."""
    roots = sorted(usable, key=lambda number: -len(usable[number].index))[:MAX_ROOTS]
    # With arrows, views of different sides can be merged before the axis of symmetry is known.
    has_arrows = all(item.yaw_deg is not None for item in usable.values())
    merged_deg = None if has_arrows and symmetry_deg else symmetry_deg
    best = max((_grown(name, usable, root, merged_deg) for root in roots), key=lambda item: len(item.merged))
    if merged_deg == symmetry_deg:
        return best
    return replace(best, template=completed(name, replace(best.template, yaw_symmetry_deg=symmetry_deg)))


def _check_symmetry(name: str, template: Template, views: Sequence[_LabeledPoints], *, needs_yaw: bool) -> None:
    """Refuse a symmetry that most views contradict, and one under which most views do not decide the yaw."""
    symmetry_deg = template.yaw_symmetry_deg
    if symmetry_deg and not _look_alike_turned(views, symmetry_deg):
        message = f"turned by {symmetry_deg:g} degrees it looks otherwise"
        raise ObjectModelError(name, message, 'symmetric: "none"')
    if not needs_yaw or symmetry_deg == 0:
        return
    undecided = [turns for view in views if (turns := _turns_deg(template, _found(template, view)[1]))]
    if len(undecided) > len(views) / 2:
        turns = max(undecided, key=len)
        message = f"{in_words(turns)} it looks the same in {len(undecided)} of {len(views)} views"
        raise ObjectModelError(name, message, f"{symmetry_remedy(template, turns)}; yaw_may_be_unknown: true")


def _turns_deg(template: Template, found: Sequence[Hypothesis]) -> tuple[float, ...]:
    """Return by which turns the template fits a view as well as in the first of the found poses."""
    return turns_deg(found[0], yaw_rivals(found, template.yaw_symmetry_deg), template.yaw_symmetry_deg)


def _look_alike_turned(views: Sequence[_LabeledPoints], symmetry_deg: float) -> bool:
    """Return whether most views fit the first one rotated by the symmetry.

    The first view itself always fits better without rotation, by its own noise: it counts only if it fits with it.
    """
    template = _first(views[0], None)
    poses = [(views[0].scene.in_lights_of(template.table_rgb)[0], views[0].yaw_deg or 0.0)]
    poses += [(lit, found[0].yaw_deg) for lit, found in (_found(template, view, views[0]) for view in views[1:])]
    first, *others = (
        looks_alike_turned(template, lit, view.index, yaw_deg, symmetry_deg)
        for view, (lit, yaw_deg) in zip(views, poses, strict=True)
    )
    votes = [first, *others] if first else others
    return sum(votes) > len(votes) / 2


def _problem(scene: Scene, index: Index) -> str:
    """Return why a view is unusable; empty if it is usable."""
    if len(index) < FEWEST_POINTS:
        known = f"its masks hold {len(index)} points above the table with known depth"
        return f"{known}, at least {FEWEST_POINTS} are needed"
    span_m = float(np.ptp(scene.points_m[index], axis=0).max())
    return f"its masks span {100 * span_m:.0f} cm, at most {100 * MAX_SPAN_M:.0f}" if span_m > MAX_SPAN_M else ""


def _grown(name: str, views: Mapping[int, _LabeledPoints], root: int, symmetry_deg: float | None) -> Learned:
    """Return the template that starts with the view `root`, with all views that fit it."""
    template = completed(name, _first(views[root], symmetry_deg))
    merged, refused = [root], dict[int, str]()
    for number in [number for number in views if number != root] * 2:  # a view may fit once others are merged
        if number in merged:
            continue
        outcome = _with(template, views[number], views[root])
        if isinstance(outcome, str):
            refused[number] = outcome
        else:
            template = completed(name, outcome)
            merged.append(number)
            refused.pop(number, None)
    return Learned(template, tuple(merged), refused)


def _first(view: _LabeledPoints, symmetry_deg: float | None) -> Template:
    """Return the template of one view; its x axis is that of the arrow."""
    scene, points_m = view.scene, view.scene.points_m[view.index]
    pose = np.eye(4)
    yaw = np.radians(view.yaw_deg or 0.0)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:2, 3] = (points_m[:, :2].min(axis=0) + points_m[:, :2].max(axis=0)) / 2
    pose[2, 3] = scene.table.level_m(pose[:3, 3])
    local_m = (points_m - pose[:3, 3]) @ pose[:3, :3]
    free = tuple(free_views(scene.views, pose, local_m, FREE_MARGIN_M))
    normals = scene.normals[view.index] @ pose[:3, :3]
    return Template(local_m, normals, scene.rgb[view.index], free, scene.table.rgb, 0.0, (), symmetry_deg)


def _found(
    template: Template, view: _LabeledPoints, root: _LabeledPoints | None = None
) -> tuple[LitScene, Sequence[Hypothesis]]:
    """Return the light that fits best, and poses of the template in a view, the best first.

    Args:
        root: with arrows in it and in the view, the starting yaws are near them; None: every yaw is tried.
    """
    has_arrows = root is not None and view.yaw_deg is not None and root.yaw_deg is not None
    yaws_deg = view.yaw_deg + ARROW_ERROR_DEG if has_arrows else START_YAWS_DEG
    lights = view.scene.in_lights_of(template.table_rgb)
    in_each = [(lit, hypotheses(template, lit, view.index, yaws_deg)) for lit in lights]
    return max(in_each, key=lambda item: item[1][0].value)


def _with(template: Template, view: _LabeledPoints, root: _LabeledPoints) -> Template | str:
    """Return the template with a view's points added, or why the view does not fit."""
    lit, found = _found(template, view, root)
    if found[0].value < MIN_SCORE:
        return f"it agrees with the others to {found[0].value:.2f}, at least {MIN_SCORE:.2f} is needed"
    if (view.yaw_deg is None or root.yaw_deg is None) and (turns := _turns_deg(template, found)):
        return f"{in_words(turns)} it fits the other views as well: a yaw with each label would decide"
    scene, index, pose = view.scene, view.index, found[0].template_to_world
    local_m = (scene.points_m[index] - pose[:3, 3]) @ pose[:3, :3]
    points_m, rgb, normals = thinned(
        np.concatenate([template.points_m, local_m]),
        np.concatenate([template.rgb, np.clip(scene.rgb[index] * lit.gain, 0, 255)]),
        np.concatenate([template.normals, scene.normals[index] @ pose[:3, :3]]),
    )
    free = (*template.free_views, *free_views(scene.views, pose, points_m, FREE_MARGIN_M))
    scores = (*template.scores, found[0].value)
    return replace(template, points_m=points_m, normals=unit(normals), rgb=rgb, free_views=free, scores=scores)
