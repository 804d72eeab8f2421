"""The decision between a pose and a refusal, from the hypotheses in every part of the scene."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from app.perception.registered.candidates import candidates, of_its_colors_within
from app.perception.registered.depth_view import Index
from app.perception.registered.hypotheses import HEADINGS, MOST, Hypothesis, hypotheses, moved, slid
from app.perception.registered.icp import angle_deg
from app.perception.registered.image_faults import image_faults
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.score import score, shares_seen
from app.perception.registered.template import STANDS_WITHIN_M, Template
from app.perception.registered.turns import RIVAL_SUPPORT, SAME_YAW_DEG, turns_deg, yaw_rivals
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError

MIN_SCORE, MIN_SUPPORT = 0.72, 0.30
USUAL_SCORE, SLACK = 0.97, 0.08  # assumed for a template of one view; accepted below the worst score of its views
SAME_PLACE_M = 0.02
ASIDE_M, ASIDE_PX = 0.015, 7.0  # an end that is not hidden contradicts a pose that is off by both
EXPLAINED_M = 0.015  # points closer than this to the object in its pose belong to it
RIVAL_SCORE, RIVAL_MARGIN = 0.55, 0.25
OVERLAP_MARGIN = 0.06  # smaller margin for a rival that overlaps the found object: two objects cannot
LIES_SCORE, LIES_BETTER = 0.6, 0.1  # least score of a lying pose, and least gain over upright ones
MAX_BELOW_M = 0.003  # of an object below the table; upright ones are within 1.5 mm (cameras 0.3 degrees and 1 mm off)
SEEN_SHARE = 0.12  # a camera sees the object if it sees this share of the side that faces it
HELP_SEE = "a view in which more of it is seen, or a further camera"
WELL_SEEN = 0.5  # share of the facing side that one camera sees where another one should see it, too


@dataclass(frozen=True, eq=False)
class FoundPose:
    """An object that was found at one place only.

    Attributes:
        best: its pose.
        shares: by camera, see `shares_seen`.
        turns_deg: by which it may as well be turned, see `app.perception.registered.turns`.
        spread_m: largest distance of their positions from the pose's.
    """

    best: Hypothesis
    shares: dict[str, float]
    turns_deg: tuple[float, ...]
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
            turns = turns_deg(first.best, [rival.best], template.yaw_symmetry_deg)
            first = replace(first, turns_deg=(*first.turns_deg, *turns))
    return first


def _find(name: str, template: Template, lit: LitScene, elsewhere: Index | None) -> FoundPose:
    """Return the pose in one light."""
    parts = candidates(template, lit, without=elsewhere)
    known = {part.tobytes(): (hypotheses(template, lit, part), part) for part in parts}
    places = sorted(known.values(), key=lambda place: -place[0][0].value * min(1.0, place[0][0].support / MIN_SUPPORT))
    if not places:
        cameras = ", ".join(view.camera.name for view in lit.scene.views)
        message = f"no camera ({cameras}) sees a part of {len(template)} points or a tenth of it that has its colors"
        within = "" if elsewhere is None else " within its masks"
        raise ObjectNotVisibleError(name, message + within + image_faults(template, lit), HELP_SEE)
    (start, *other_yaws), part = places[0]
    first = slid(template, lit, part, start)
    best = _with_all_within(template, lit, first, part, elsewhere)
    shares = shares_seen(template, lit, best.pose)
    _check(name, template, lit, best, shares, parts)
    _check_height(name, template, lit, best)
    _check_ends(name, template, lit, best, part)
    leftover = [part for part in _leftover(template, lit, best, elsewhere) if part.tobytes() not in known]
    rivals = [place[0] for place, _ in places[1:]] + [hypotheses(template, lit, part)[0] for part in leftover]
    _check_alone(name, template, best, rivals)
    turned = yaw_rivals([first, *other_yaws], template.yaw_symmetry_deg)
    spread_m = max((float(np.linalg.norm(rival.origin_m - best.origin_m)) for rival in turned), default=0.0)
    return FoundPose(best, shares, turns_deg(first, turned, template.yaw_symmetry_deg), spread_m)


def _with_all_within(
    template: Template, lit: LitScene, best: Hypothesis, part: Index, elsewhere: Index | None
) -> Hypothesis:
    """Return a pose, its value reduced by what lies within the object where it was open: a mug upside down.

    A part that was searched may lack such points, as they look a little different from the rest.
    """
    within = of_its_colors_within(template, lit, best.pose)
    further = np.setdiff1d(within, part if elsewhere is None else np.union1d(part, elsewhere))
    if not len(further):
        return best
    index = np.random.default_rng(0).permutation(np.concatenate([part, further]))[:MOST]
    value = float(score(template, lit, index, best.pose, MOST).value[0]) * best.color
    return replace(best, value=min(best.value, value))


def _check(
    name: str, template: Template, lit: LitScene, best: Hypothesis, shares: dict[str, float], parts: Sequence[Index]
) -> None:
    """Refuse a pose that matches badly, or of an object of which too little is visible."""
    seen = ", ".join(f"{camera} {100 * share:.0f} %" for camera, share in shares.items())
    least_score = max(MIN_SCORE, min(template.scores, default=USUAL_SCORE) - SLACK)
    if best.value < least_score:
        faults = image_faults(template, lit)
        if hypotheses(template, lit, parts[0], fallen=True)[0].value > max(LIES_SCORE, best.value + LIES_BETTER):
            message = f"it seems to lie on its side, or to be absent: it is found upright only{faults}"
            raise UncertainPoseError(name, message, "it upright")
        message = f"what looks most like it scores {best.value:.2f} of at least {least_score:.2f}"
        if best.color < 1:
            message += ", as it has its shape in other colors, or much brighter or darker"
        remedy = "it upright on the table, uncovered; or labeled views in this light and from this side"
        message += f" (of its facing side agree: {seen}){faults}"
        blind = [camera for camera, share in shares.items() if share < max(shares.values()) / 2]
        if blind and max(shares.values()) > WELL_SEEN:
            message += f"; {' and '.join(blind)}: hidden there, an old picture, or camera_to_world is off"
        raise ObjectNotVisibleError(name, message, remedy)
    if best.support < MIN_SUPPORT:
        message = f"only {100 * best.support:.0f} % of the side that faces the cameras is seen ({seen})"
        raise UncertainPoseError(name, f"{message}, at least {100 * MIN_SUPPORT:.0f} % is needed", HELP_SEE)


def _check_height(name: str, template: Template, lit: LitScene, best: Hypothesis) -> None:
    """Refuse a standing object whose bottom would lie below the table: it fits best so if it lies on another side."""
    standing_m = lit.scene.table.level_m(best.origin_m) - template.bottom_m
    below_m = standing_m - float(best.origin_m[2])
    if template.above_table_m < STANDS_WITHIN_M and below_m > MAX_BELOW_M:
        message = f"it fits best {1000 * below_m:.0f} mm below the table, as if it lay on another side"
        remedy = "it upright, as it was labeled; or labels of it on this table, if something flat lay below it"
        raise UncertainPoseError(name, f"{message}; at most {1000 * MAX_BELOW_M:g} mm are tolerated", remedy)


def _check_ends(name: str, template: Template, lit: LitScene, best: Hypothesis, part: Index) -> None:
    """Refuse a pose that may as well be moved aside: of a long object only the middle is seen."""
    aside_m = max(ASIDE_M, ASIDE_PX * lit.scene.pixel_m(best.origin_m))
    index = np.random.default_rng(0).permutation(part)[:MOST]
    poses = moved(best.pose, np.vstack([np.zeros(3), aside_m * HEADINGS]))
    evidence = score(template, lit, index, poses, MOST).evidence
    here, *aside = (replace(best, evidence=item) for item in evidence)
    for heading, there in zip(HEADINGS, aside, strict=True):
        if not here.beats(there):
            along = "x" if abs(heading[0]) > abs(heading[1]) else "y"
            message = f"its place along {along} is undecided: moved by {100 * aside_m:.1f} cm it fits as well"
            raise UncertainPoseError(name, f"{message}, as its ends are hidden", HELP_SEE)


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
