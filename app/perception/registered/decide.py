"""The decision between a pose and a refusal, from the hypotheses in every part of the scene."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from app.perception.frame_checks import are_swapped
from app.perception.registered.candidates import SAME_LAB, candidates
from app.perception.registered.geometry import Index, angle_deg
from app.perception.registered.hypotheses import Hypothesis, hypotheses
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.score import shares_seen
from app.perception.registered.template import Template
from app.perception.registered.view import DepthView
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.cameras.table import MAX_OFF_M, OTHER_M, find_flat_surface
from roboprompt_client.types.camera import RgbdFrame

MIN_SCORE, MIN_SUPPORT = 0.72, 0.30
USUAL_SCORE, SLACK = 0.97, 0.08  # assumed for a template of one view; accepted below the worst score of its views
SAME_YAW_DEG, SAME_PLACE_M = 14.0, 0.02
EXPLAINED_M = 0.015  # points closer than this to the object in its pose belong to it
RIVAL_SCORE, RIVAL_MARGIN, RIVAL_SUPPORT = 0.55, 0.25, 0.12
OVERLAP_MARGIN = 0.06  # smaller margin for a rival that overlaps the found object: two objects cannot
LIES_SCORE, LIES_BETTER = 0.6, 0.1  # least score of a lying pose, and least gain over upright ones
SEEN_SHARE = 0.12  # a camera sees the object if it sees this share of the side that faces it
HELP_SEE = "a view in which more of it is seen, or a further camera"
WELL_SEEN = 0.5  # share of the facing side that one camera sees where another one should see it, too
OTHER_TABLE_RGB = 25.0  # of 255
STEP_PX = 4  # stride of the pixels that are checked for missing depth
MIN_PIXELS, MIN_SHARE = 200, 0.8  # of pixels of the object's colors, without depth, to be reported


@dataclass(frozen=True, eq=False)
class FoundPose:
    """An object that was found at one place only.

    Attributes:
        best: its pose.
        shares: by camera, see `shares_seen`.
        yaw_rivals: number of other yaws that explain the scene as well.
        spread_m: largest distance of their positions from the pose's.
    """

    best: Hypothesis
    shares: dict[str, float]
    yaw_rivals: int
    spread_m: float

    @property
    def cameras(self) -> tuple[str, ...]:
        """The cameras that see it."""
        seeing = tuple(name for name, share in self.shares.items() if share >= SEEN_SHARE)
        return seeing or (max(self.shares, key=self.shares.__getitem__),)


def find(name: str, template: Template, scene: Scene, elsewhere: Index | None = None) -> FoundPose:
    """Return the pose of the object `name`.

    If light and table may both have changed, it must be found in the light that the table shows: a white cup in half
    the light looks like a gray one on another table. What is found on another table only can contradict that.

    Args:
        elsewhere: indices of points outside of its masks, which are ignored.

    Raises:
        ObjectNotVisibleError: if nothing has its colors and shape.
        UncertainPoseError: if too little of it is visible, it lies on its side, or another place matches, too.
    """
    likeliest, *others = scene.in_lights_of(template.table_rgb)
    found = [_find(name, template, likeliest, elsewhere)]
    for lit in others:
        with suppress(ObjectNotVisibleError):
            found.append(_find(name, template, lit, elsewhere))
    first, *rivals = sorted(found, key=lambda item: -item.best.value)
    for rival in rivals:
        _check_alone(name, template, first.best, [rival.best])
        if angle_deg(first.best.rotation, rival.best.rotation, template.yaw_symmetry_deg) > SAME_YAW_DEG:
            first = replace(first, yaw_rivals=first.yaw_rivals + 1 + rival.yaw_rivals)
    return first


def _find(name: str, template: Template, lit: LitScene, elsewhere: Index | None) -> FoundPose:
    """Return the pose in one light."""
    parts = candidates(template, lit, without=elsewhere)
    known = {part.tobytes(): hypotheses(template, lit, part) for part in parts}
    places = sorted(known.values(), key=lambda place: -place[0].value * min(1.0, place[0].support / MIN_SUPPORT))
    if not places:
        cameras = ", ".join(view.camera.name for view in lit.scene.views)
        message = f"no camera ({cameras}) sees a part of {len(template)} points or a tenth of it that has its colors"
        within = "" if elsewhere is None else " within its masks"
        raise ObjectNotVisibleError(name, message + within + causes(template, lit), HELP_SEE)
    best = places[0][0]
    shares = shares_seen(template, lit, best.pose)
    _check(name, template, lit, best, shares, parts)
    leftover = [part for part in _leftover(template, lit, best, elsewhere) if part.tobytes() not in known]
    rivals = [place[0] for place in places[1:]] + [hypotheses(template, lit, part)[0] for part in leftover]
    _check_alone(name, template, best, rivals)
    turned = yaw_rivals(template, places[0])
    spread_m = max((float(np.linalg.norm(rival.origin_m - best.origin_m)) for rival in turned), default=0.0)
    return FoundPose(best, shares, len(turned), spread_m)


def yaw_rivals(template: Template, place: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the poses of other yaws that the evidence does not distinguish from the first."""
    best, symmetry_deg = place[0], template.yaw_symmetry_deg
    if symmetry_deg == 0:
        return []
    return [
        other
        for other in place[1:]
        if angle_deg(best.rotation, other.rotation, symmetry_deg) > SAME_YAW_DEG
        and other.support > RIVAL_SUPPORT
        and not best.beats(other)
    ]


def _check(
    name: str, template: Template, lit: LitScene, best: Hypothesis, shares: dict[str, float], parts: Sequence[Index]
) -> None:
    """Refuse a pose that matches badly, or of an object of which too little is visible."""
    seen = ", ".join(f"{camera} {100 * share:.0f} %" for camera, share in shares.items())
    least_score = max(MIN_SCORE, min(template.scores, default=USUAL_SCORE) - SLACK)
    if best.value < least_score:
        if hypotheses(template, lit, parts[0], fallen=True)[0].value > max(LIES_SCORE, best.value + LIES_BETTER):
            message = f"it seems to lie on its side, or to be absent: it is found upright only{causes(template, lit)}"
            raise UncertainPoseError(name, message, "it upright")
        message = f"what looks most like it scores {best.value:.2f} of at least {least_score:.2f}"
        if best.color < 1:
            message += ", as it has its shape in other colors, or much brighter or darker"
        remedy = "it upright on the table, uncovered; or labeled views in this light and from this side"
        message += f" (of its facing side agree: {seen}){causes(template, lit)}"
        blind = [camera for camera, share in shares.items() if share < max(shares.values()) / 2]
        if blind and max(shares.values()) > WELL_SEEN:
            message += f"; {' and '.join(blind)}: hidden there, or camera_to_world is off"
        raise ObjectNotVisibleError(name, message, remedy)
    if best.support < MIN_SUPPORT:
        message = f"only {100 * best.support:.0f} % of the side that faces the cameras is seen ({seen})"
        raise UncertainPoseError(name, f"{message}, at least {100 * MIN_SUPPORT:.0f} % is needed", HELP_SEE)


def _check_alone(name: str, template: Template, best: Hypothesis, rivals: Sequence[Hypothesis]) -> None:
    """Refuse a pose if the object may be at another place as well."""
    for rival in rivals:
        apart_m = float(np.linalg.norm(rival.origin_m - best.origin_m))
        margin = OVERLAP_MARGIN if apart_m < template.narrowest_m else RIVAL_MARGIN
        is_good = rival.value > max(RIVAL_SCORE, best.value - margin) and rival.support > RIVAL_SUPPORT
        if apart_m > SAME_PLACE_M and is_good:
            places = " and ".join(
                f"x = {item.origin_m[0]:.2f}, y = {item.origin_m[1]:.2f} m (score {item.value:.2f})"
                for item in (best, rival)
            )
            message = f"two places look like it, {100 * apart_m:.0f} cm apart: {places}"
            remedy = "one of its kind in view, or labeled views that show the difference"
            raise UncertainPoseError(name, message, remedy)


def _leftover(template: Template, lit: LitScene, best: Hypothesis, elsewhere: Index | None) -> Sequence[Index]:
    """Return parts of points that the found object does not explain, e.g. of another one that touches it."""
    explained = template.distance_m(best.pose.to_template(lit.scene.points_m)[0]) < EXPLAINED_M
    if elsewhere is not None:
        explained[elsewhere] = True
    return candidates(template, lit, without=np.flatnonzero(explained))


def causes(template: Template, lit: LitScene) -> str:
    """Return likely faults of images in which an object was not found, as the end of a message; may be empty."""
    notes = [_without_depth(template, lit, number) for number in range(len(lit.scene.views))]
    notes += [_bumped(view, lit.scene) for view in lit.scene.views]
    taught_rgb, table = template.table_rgb, lit.scene.table
    if are_swapped(taught_rgb, table.rgb):
        notes.append("the table has its taught color if red and blue change places: BGR images?")
    elif np.abs(taught_rgb - table.rgb).max() > OTHER_TABLE_RGB:
        notes.append("the table looks otherwise than in its labeled views")
    return "".join(f"; {note}" for note in notes if note)


def _bumped(view: DepthView, scene: Scene) -> str:
    surface = find_flat_surface(RgbdFrame(view.camera, None, view.depth_m))
    off_m = 0.0 if surface is None else float(scene.table.height_m(surface.middle_m[None])[0])
    if not MAX_OFF_M < abs(off_m) < OTHER_M:
        return ""
    return f"{view.camera.name} sees the table {1000 * off_m:+.0f} mm off: was the camera bumped?"


def _without_depth(template: Template, lit: LitScene, number: int) -> str:
    view = lit.scene.views[number]
    rows, columns = STEP_PX * np.indices(view.depth_m[::STEP_PX, ::STEP_PX].shape).reshape(2, -1)
    off_lab, _ = template.palette.query(lit.lab_at(number, rows, columns), distance_upper_bound=SAME_LAB)
    depths_m = view.depth_m[rows, columns][np.isfinite(off_lab)]
    unknown = int(np.count_nonzero(depths_m == 0))
    if unknown * STEP_PX**2 < MIN_PIXELS or unknown < MIN_SHARE * len(depths_m):
        return ""
    return f"{view.camera.name} has no depth for {100 * unknown / len(depths_m):.0f} % of the pixels of its colors"
