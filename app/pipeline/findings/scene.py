"""What is doubtful about an observed scene: alone, beside those of demonstrations, and in the roles of its objects."""

from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding, Severity
from app.pipeline.findings.places import (
    FIXED_M,
    MIN_DEMONSTRATIONS,
    ShownPlaces,
    ShownScenes,
    apart_m,
    estimated_error_m,
)
from app.pipeline.order.lexicon import phrase_of
from app.pipeline.order.order import Order
from app.pipeline.order.vocabulary import ADJECTIVES, NOUN_KINDS
from roboprompt_client.trajectory import ObjectPose

UNSURE_CONFIDENCE = 0.7  # of a pose
# The thresholds below are measured: docs/results/findings.md.
BEYOND_M = 0.05  # and the share 1 / N of the range of N demonstrations
FAR_BEYOND_M = 0.30
TURNED_DEG = 10.0  # and the share 4 / N of the range
TILT_DEG = 20.0
LIFTED_M = 0.011
UPRIGHT_DEG = 0.5  # noise that lifts an object tilts it, too
NOISE_M = 0.016  # 1 cm fails seldom, 3 cm mostly
APART_SHARE = 0.5  # of the least distance between two objects in demonstrations
ARRANGED_M = 0.03


def scene_findings(query: Query, scenes: ShownScenes) -> tuple[Finding, ...]:
    """What deserves a look, causes first: at most one finding for each object, and one for all of them together.

    Args:
        query: the objects as they were observed.
        scenes: of the demonstrations of the prompt, with the same objects; none where they are not known.
    """
    observed, shown = query.objects, scenes.demonstrations
    uncertain = tuple(_uncertain(observed))
    if len(shown) < MIN_DEMONSTRATIONS:
        return uncertain
    places = [scenes.places(pose.name) for pose in observed]
    found, confused = _one_place(observed, scenes)
    of_objects = [next(_place(*item), None) for item in zip(observed, places, strict=True) if item[0] not in confused]
    found += [finding for finding in of_objects if finding is not None]
    if not found:
        found += [*_noise(observed, places), *_arranged(query, shown)][:1]
    return (*uncertain, *found)


def _uncertain(observed: Sequence[ObjectPose]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE_CONFIDENCE or pose.reason:
            reason = f": {pose.reason}" if pose.reason else ""
            message = f"The pose of {pose.name} is not certain ({pose.estimator}, {pose.confidence:.2f}){reason}."
            severity: Severity = "warning" if pose.confidence < UNSURE_CONFIDENCE else "info"
            numbers = {"confidence": pose.confidence}
            yield Finding("uncertain-pose", severity, message, f"objects[{pose.name}]", numbers)


def _one_place(observed: Sequence[ObjectPose], scenes: ShownScenes) -> tuple[list[Finding], tuple[ObjectPose, ...]]:
    """Two objects that an estimator took for one, which explains whatever else is odd about them."""
    for one, other in combinations(observed, 2):
        off_m = apart_m(one, other)
        least_m = scenes.least_apart_m(one.name, other.name)
        if least_m > FIXED_M and off_m < APART_SHARE * least_m:
            message = (
                f"{one.name} and {other.name} are seen {100 * off_m:.1f} cm apart, in no demonstration less than"
                f" {100 * least_m:.1f} cm: one is taken for the other."
            )
            numbers = {"apart_m": off_m, "least_m": least_m}
            return [Finding("objects-in-one-place", "danger", message, f"objects[{one.name}]", numbers)], (one, other)
    return [], ()


def _place(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    """Doubts about one object, the most telling first: outside the demonstrations, rows have not been shown to hold."""
    return chain(_tilted(pose, places), _lifted(pose, places), _beyond(pose, places), _turned(pose, places))


def _tilted(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    off_deg = places.tilted_beyond_deg(pose)
    if off_deg > TILT_DEG:
        message = f"{pose.name} is tilted by {off_deg:.0f} degrees more than in any demonstration: has it fallen over?"
        yield Finding("object-tilted", "danger", message, f"objects[{pose.name}]", {"tilt_deg": off_deg})


def _lifted(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    off_m = places.lifted_m(pose)
    if off_m > LIFTED_M and places.leans_deg(pose) < UPRIGHT_DEG:
        message = (
            f"{pose.name} stands {100 * off_m:.1f} cm above or below where every demonstration has it: is it another"
            " object, or on something?"
        )
        yield Finding("object-at-another-height", "warning", message, f"objects[{pose.name}]", {"off_m": off_m})


def _beyond(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    beyond_m = places.beyond_m(pose)
    axis = int(np.argmax(beyond_m - places.range_m / places.number))
    if beyond_m[axis] <= BEYOND_M + places.range_m[axis] / places.number:
        return
    far_m = float(beyond_m[axis])
    message = (
        f"{pose.name} lies {100 * far_m:.0f} cm beyond the demonstrations along {'xyz'[axis]}: they have it from"
        f" {places.low_m[axis]:.3f} to {places.high_m[axis]:.3f} m. Is it another object? If not, demonstrate"
        " nearer to it."
    )
    severity: Severity = "danger" if far_m > FAR_BEYOND_M else "warning"
    numbers = {"beyond_m": far_m}
    yield Finding("object-beyond-demonstrations", severity, message, f"objects[{pose.name}]", numbers)


def _turned(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    beyond_deg, range_deg = places.turned_beyond_deg(pose)
    if beyond_deg > TURNED_DEG + 4 * range_deg / places.number:
        message = (
            f"{pose.name} is turned by {beyond_deg:.0f} degrees beyond the demonstrations, which have it within"
            f" {range_deg:.0f} degrees."
        )
        yield Finding("object-turned", "warning", message, f"objects[{pose.name}]", {"beyond_deg": beyond_deg})


def _noise(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> Iterator[Finding]:
    """Objects that stand alike in all demonstrations show how far their poses are off."""
    error_m = estimated_error_m(observed, places)
    if error_m > NOISE_M:
        message = (
            f"Heights and tilts differ from those that all demonstrations share: poses are off by about"
            f" {100 * error_m:.1f} cm, and grasps may miss. Check calibration and estimator."
        )
        yield Finding("noisy-observation", "warning", message, "objects", {"error_m": error_m})


def _arranged(query: Query, shown: Sequence[Demonstration]) -> Iterator[Finding]:
    """Objects that the instruction names stand to each other as in every demonstration, whichever they are."""
    asked, named = query.order.objects, [demonstration.order.objects for demonstration in shown]
    if any(len(names) != len(asked) for names in named):
        return
    for i, j in combinations(range(len(asked)), 2):
        ways_m = np.array(
            [d.object(n[i]).position_m - d.object(n[j]).position_m for d, n in zip(shown, named, strict=True)]
        )
        way_m = query.object(asked[i]).position_m - query.object(asked[j]).position_m
        beyond_m = np.maximum(way_m - ways_m.max(axis=0), 0) + np.maximum(ways_m.min(axis=0) - way_m, 0)
        off_m = float((beyond_m * (np.ptp(ways_m, axis=0) < FIXED_M)).max())
        if off_m > ARRANGED_M:
            message = (
                f"{asked[i]} lies {100 * off_m:.1f} cm from where it stands to {asked[j]} in every demonstration: is"
                " one taken for the other?"
            )
            where = f"objects[{asked[i]}]"
            yield Finding("objects-arranged-otherwise", "warning", message, where, {"off_m": off_m})
            return


class Stranger(NamedTuple):
    """An object that stands where demonstrations have others.

    Attributes:
        instead_of: what they have there.
        named_elsewhere: whether taught instructions name it in another place: its part is another one.
    """

    name: str
    instead_of: tuple[str, ...]
    named_elsewhere: bool


def strangers(asked: Order, taught: Sequence[str]) -> Iterator[Stranger]:
    """Of each clause the objects of another kind than the taught ones in their place.

    Args:
        asked: in the form of taught instructions.
    """
    shown = [clause for text in taught for clause in Order(text, asked.names).clauses]
    known = {name for clause in shown for name in clause.objects}
    usual = {(clause.verb, place, name) for clause in shown for place, name in enumerate(clause.objects)}
    for clause in asked.clauses:
        alike = [other.objects for other in shown if other.form == clause.form]
        for place, name in enumerate(clause.objects if alike else ()):
            there = tuple(dict.fromkeys(objects[place] for objects in alike))
            as_usual = (clause.verb, place, name) in usual  # put on another thing, but put
            if not as_usual and _kind(name).isdisjoint(frozenset().union(*map(_kind, there))):
                yield Stranger(name, there, name in known)


def _kind(name: str) -> frozenset[str]:
    """Its noun and those of the same kind."""
    words = [word for word in phrase_of(name) if word not in ADJECTIVES and len(word) > 1]
    noun = words[-1] if words else name
    return frozenset({noun}).union(*(kind for kind in NOUN_KINDS if noun in kind))
