"""What is doubtful about an observed scene: alone, beside those of demonstrations, and in the roles of its objects."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import SEVERITIES, Finding, rules, worst_severity
from app.pipeline.findings.arrangement import arranged_findings, parted_findings, sided_findings
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
from roboprompt_client.types.poses import ObjectPose

UNSURE_CONFIDENCE = 0.7  # of a pose that deserves a look without a reason
UPRIGHT_DEG = 0.5  # noise that lifts an object tilts it, too
REPEATED_M = 1e-5  # between two measured poses of an object, at least
APART_SHARE = 0.5  # of the least distance between two objects in demonstrations


def scene_findings(
    query: Query, scenes: ShownScenes, followed: frozenset[str] = frozenset(), needed: frozenset[str] | None = None
) -> tuple[Finding, ...]:
    """What deserves a look, causes first; a lesser doubt hides no greater one.

    Args:
        query: the objects as they were observed.
        scenes: of the demonstrations, with the same objects; none where they are not known.
        followed: the objects that rows of the asked motion are relative to.
        needed: the objects whose places matter; None: all.
    """
    observed, shown = query.objects, scenes.demonstrations
    uncertain = tuple(_uncertain(observed))
    if len(shown) < MIN_DEMONSTRATIONS:
        return uncertain
    places = [scenes.places(pose.name) for pose in observed]
    if (old := _of_a_demonstration(observed, places, (*shown, *scenes.left_out))) is not None:
        return (*uncertain, old)
    found, confused = _confused(observed, scenes)
    for pose, of_pose in zip(observed, places, strict=True):
        found += [] if pose in confused or not (needed is None or pose.name in needed) else _place(pose, of_pose)
    parted = list(parted_findings(query, scenes.pairs, followed)) or list(arranged_findings(query, shown, followed))
    parted = _greater(list(sided_findings(query, scenes.sides, followed)), parted) or parted
    found += [] if confused else _greater(parted, found)
    found += _greater(_noise(observed, places), found)
    return (*uncertain, *found)


def other_objects(absent: Sequence[str], new: Sequence[str]) -> tuple[Finding, ...]:
    """Says that a scene has other objects than the task's, by their names."""
    if not (absent or new):
        return ()
    message = (
        f"The scene has other objects around than demonstrations: missing {', '.join(absent) or 'none'}; new"
        f" {', '.join(new) or 'none'}. No row follows them and no words name them."
    )
    return (rules.OTHER_OBJECTS.finding(message, "objects", {"missing": len(absent), "new": len(new)}),)


def _greater(findings: Sequence[Finding], known: Sequence[Finding]) -> list[Finding]:
    """Those that are severer than all that is known already, which explains the others."""
    worst = worst_severity(known)
    return [item for item in findings if worst is None or SEVERITIES.index(item.severity) > SEVERITIES.index(worst)]


def _uncertain(observed: Sequence[ObjectPose]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE_CONFIDENCE or pose.reason:
            reason = f": {pose.reason}" if pose.reason else ""
            message = f"The pose of {pose.name} is not certain ({pose.estimator}, {pose.confidence:.2f}){reason}."
            numbers = {"confidence": pose.confidence}
            unsure = float(pose.confidence < UNSURE_CONFIDENCE)
            yield rules.UNCERTAIN_POSE.finding(message, f"objects[{pose.name}]", numbers, value=unsure)


def _of_a_demonstration(
    observed: Sequence[ObjectPose], places: Sequence[ShownPlaces], shown: Sequence[Demonstration]
) -> Finding | None:
    """A scene whose objects are, as nothing measured twice is, where one demonstration had them before it moved them.

    Objects that never move do not count, nor do places that people write down, in whole millimeters.
    """
    moved = [pose for pose, place in zip(observed, places, strict=True) if place.range_m.max() > FIXED_M]
    if not moved:
        return None
    seen_m = np.array([pose.position_m for pose in moved])
    if np.abs(seen_m - seen_m.round(3)).max() < REPEATED_M:
        return None
    for old in shown:
        if all(np.abs(old.object(pose.name).position_m - pose.position_m).max() < REPEATED_M for pose in moved):
            message = (
                f"All objects stand to a hundredth of a millimeter where demonstration {old.id} had them, which no"
                " camera sees twice: is it an old observation?"
            )
            return rules.OLD_SCENE.finding(message, "objects")
    return None


def _confused(observed: Sequence[ObjectPose], scenes: ShownScenes) -> tuple[list[Finding], tuple[ObjectPose, ...]]:
    """Two objects that an estimator took for one, or for each other: that explains whatever else is odd about them."""
    for one, other in combinations(observed, 2):
        off_m = _exchanged_m(one, other, scenes)
        message = (
            f"{one.name} and {other.name} each stand {100 * off_m:.1f} cm or more above or below where every"
            " demonstration has them, and with their names exchanged where it does: one is taken for the other."
        )
        if swapped := rules.HEIGHTS_EXCHANGED.findings(off_m, message, f"objects[{one.name}]", {"off_m": off_m}):
            return list(swapped), (one, other)
        off_m = apart_m(one, other)
        least_m = scenes.least_apart_m(one.name, other.name)
        if least_m > FIXED_M and off_m < APART_SHARE * least_m:
            message = (
                f"{one.name} and {other.name} are seen {100 * off_m:.1f} cm apart, in no demonstration less than"
                f" {100 * least_m:.1f} cm: one is taken for the other."
            )
            numbers = {"apart_m": off_m, "least_m": least_m}
            return [rules.ONE_PLACE.finding(message, f"objects[{one.name}]", numbers)], (one, other)
    return [], ()


def _exchanged_m(one: ObjectPose, other: ObjectPose, scenes: ShownScenes) -> float:
    """How far above or below both are at least, beyond what would be left with their names exchanged."""
    places = scenes.places(one.name), scenes.places(other.name)
    if max(place.range_m[2] for place in places) >= FIXED_M:
        return 0.0
    off_m = min(place.lifted_m(pose) for place, pose in zip(places, (one, other), strict=True))
    left_m = max(place.lifted_m(pose) for place, pose in zip(places, (other, one), strict=True))
    return off_m if left_m < off_m / 2 else 0.0


def _place(pose: ObjectPose, places: ShownPlaces) -> list[Finding]:
    """Doubts about one object, one of each kind: outside the demonstrations, rows have not been shown to hold."""
    where = f"objects[{pose.name}]"
    tilt_deg = places.tilted_beyond_deg(pose)
    message = f"{pose.name} is tilted by {tilt_deg:.0f} degrees more than in any demonstration: has it fallen over?"
    tilted = rules.TILTED.findings(tilt_deg, message, where, {"tilt_deg": tilt_deg})
    off_m = places.lifted_m(pose) if places.leans_deg(pose) < UPRIGHT_DEG else 0.0
    message = (
        f"{pose.name} stands {100 * off_m:.1f} cm above or below where every demonstration has it: is it another"
        " object, or on something?"
    )
    lifted = rules.HEIGHT.findings(off_m, message, where, {"off_m": off_m})
    turned = () if tilted else _turned(pose, places)  # what has fallen over has no yaw
    return [*tilted, *lifted, *_beyond(pose, places), *turned]


def _beyond(pose: ObjectPose, places: ShownPlaces) -> tuple[Finding, ...]:
    off = places.off_box(pose.position_m)
    message = (
        f"{pose.name} lies {100 * off.far_m:.0f} cm beyond the demonstrations along {off.axis}: they have it from"
        f" {off.range_text}. Is it another object? If not, demonstrate nearer to it."
    )
    return rules.BEYOND.findings(off.doubtful_m, message, f"objects[{pose.name}]", {"beyond_m": off.far_m})


def _turned(pose: ObjectPose, places: ShownPlaces) -> tuple[Finding, ...]:
    beyond_deg, range_deg = places.turned_beyond_deg(pose)
    if rules.TURNED.severity(beyond_deg - 4 * range_deg / places.number) is None:
        return ()
    message = (
        f"{pose.name} is turned by {beyond_deg:.0f} degrees beyond the demonstrations, which have it within"
        f" {range_deg:.0f} degrees."
    )
    return rules.TURNED.findings(beyond_deg, message, f"objects[{pose.name}]", {"beyond_deg": beyond_deg})


def _noise(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> tuple[Finding, ...]:
    """Objects that stand alike in all demonstrations show how far their poses are off."""
    error_m = estimated_error_m(observed, places)
    message = (
        f"Heights and tilts differ from those that all demonstrations share: poses are off by about"
        f" {100 * error_m:.1f} cm, and grasps may miss. Check calibration and estimator."
    )
    return rules.NOISY.findings(error_m, message, "objects", {"error_m": error_m})


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
    words = [word for word in phrase_of(name) if word not in ADJECTIVES and len(word) > 1]
    noun = words[-1] if words else name
    return frozenset({noun}).union(*(kind for kind in NOUN_KINDS if noun in kind))
