"""Findings about an observed scene: uncertain poses, and objects unlike the demonstrations."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding, rules, worst_severity
from app.pipeline.findings.demonstrated_scenes import ShownScenes, arrangement_findings
from app.pipeline.findings.object_pose import REPEATED_M, in_millimeters, pose_findings
from app.pipeline.findings.places import FIXED_M, MANY, MIN_DEMONSTRATIONS, ShownPlaces, estimated_error_m
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.severity import SEVERITIES

UNSURE_CONFIDENCE = 0.7  # a pose of less confidence is reported even if the estimator gives no reason
APART_SHARE = 0.5  # of the least distance of two objects in MANY demonstrations: nearer ones are one object


def scene_findings(
    query: Query,
    scenes: ShownScenes,
    followed: frozenset[str] = frozenset(),
    turning: frozenset[str] | None = None,
    needed: frozenset[str] | None = None,
) -> tuple[Finding, ...]:
    """Return the findings, causes first; findings that a cause explains are left out unless they are severer.

    Args:
        query: the observed objects.
        scenes: the demonstrations' scenes, with the same objects; empty where they are not known.
        followed: the objects that rows of the requested motion are relative to.
        turning: those whose own axes these rows follow; None: perhaps all.
        needed: the objects whose places matter; None: all.
    """
    observed, shown = query.objects, scenes.demonstrations
    uncertain = tuple(_uncertain(observed))
    if len(shown) < MIN_DEMONSTRATIONS:
        return uncertain
    places = [scenes.places[pose.name] for pose in observed]
    if (old := _repeated(observed, places, (*shown, *scenes.left_out), followed)) is not None:
        return (*uncertain, old)
    found, confused = _confused(observed, scenes)
    for pose, of_pose in zip(observed, places, strict=True):
        matters = needed is None or pose.name in needed
        if matters and pose not in confused:
            found += pose_findings(pose, of_pose, turns=turning is None or pose.name in turning)
    arranged = list(arrangement_findings(query, scenes, followed))
    arranged = [item for item in arranged if item.severity == "danger"][:1] or arranged[:1]
    found += [] if confused else _severer(arranged, found)
    found += _severer(_noise(observed, places), found)
    return (*uncertain, *found)


def other_objects(absent: Sequence[str], new: Sequence[str]) -> tuple[Finding, ...]:
    """Return a finding if the scene lacks objects of the task (`absent`) or has others (`new`)."""
    if not (absent or new):
        return ()
    message = (
        f"The scene has other objects than the demonstrations: missing {', '.join(absent) or 'none'}; new"
        f" {', '.join(new) or 'none'}. Neither the motion nor the instruction refers to them."
    )
    return (rules.OTHER_OBJECTS.finding(message, "objects", {"missing": len(absent), "new": len(new)}),)


def _repeated(
    observed: Sequence[ObjectPose],
    places: Sequence[ShownPlaces],
    shown: Sequence[Demonstration],
    followed: frozenset[str],
) -> Finding | None:
    """Return a finding if objects are exactly where one demonstration had them, as no two measurements are.

    All of them, or one that the motion follows and that demonstrations never have twice in one place. Objects that
    never move do not count, nor do positions in whole millimeters, which people write by hand.
    """
    moved = [pose for pose, place in zip(observed, places, strict=True) if place.box_m.width.max() > FIXED_M]
    if not moved or all(map(in_millimeters, moved)):
        return None
    by_name_m = {pose.name: np.array([old.object(pose.name).position_m for old in shown]) for pose in moved}
    repeats = {pose.name: _repeats(pose.position_m, by_name_m[pose.name]) for pose in moved}
    stale = np.logical_and.reduce(list(repeats.values()))
    if stale.any():
        what, where = "All objects are", "objects"
    else:
        one = next((pose for pose in moved if pose.name in followed and _stale(pose, by_name_m[pose.name])), None)
        if one is None:
            return None
        what, where, stale = f"{one.name} is", f"objects[{one.name}]", repeats[one.name]
    message = (
        f"{what} exactly (to 0.01 mm) where demonstration {shown[int(stale.argmax())].id} had"
        f" {'them' if where == 'objects' else 'it'}; no camera measures that twice. This is probably an old"
        " observation: observe the scene again."
    )
    return rules.SCENE_OF_A_DEMONSTRATION.finding(message, where)


def _stale(pose: ObjectPose, places_m: Array) -> bool:
    """Return whether an object is where one of its places (N, 3) was, which are all different."""
    if in_millimeters(pose) or not _repeats(pose.position_m, places_m).any():
        return False
    return all(not _repeats(place_m, places_m[:k]).any() for k, place_m in enumerate(places_m))


def _repeats(place_m: Array, places_m: Array) -> npt.NDArray[np.bool_]:
    repeats: npt.NDArray[np.bool_] = np.abs(places_m - place_m).max(axis=1) < REPEATED_M
    return repeats


def _severer(findings: Sequence[Finding], known: Sequence[Finding]) -> list[Finding]:
    """Return the findings that are severer than all `known` ones, which explain the others."""
    worst = worst_severity(known)
    return [item for item in findings if worst is None or SEVERITIES.index(item.severity) > SEVERITIES.index(worst)]


def _uncertain(observed: Sequence[ObjectPose]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE_CONFIDENCE or pose.reason:
            reason = f": {pose.reason}" if pose.reason else ""
            message = (
                f"The pose of {pose.name} is uncertain ({pose.estimator}, confidence {pose.confidence:.2f}){reason}."
                " Compare it with the camera's picture."
            )
            numbers = {"confidence": pose.confidence}
            unsure = float(pose.confidence < UNSURE_CONFIDENCE)
            yield rules.UNCERTAIN_POSE.finding(message, f"objects[{pose.name}]", numbers, value=unsure)


def _confused(observed: Sequence[ObjectPose], scenes: ShownScenes) -> tuple[list[Finding], tuple[ObjectPose, ...]]:
    """Return a finding, and the two objects, if an estimator took these for one or for each other.

    That explains every other finding about the two.
    """
    # The least distance of N places in a plane falls as 1 / sqrt(N): of few demonstrations it is still large.
    apart_share = APART_SHARE * min(1.0, math.sqrt(len(scenes.demonstrations) / MANY))
    for one, other in combinations(observed, 2):
        off_m = _height_error_if_exchanged_m(one, other, scenes)
        message = (
            f"{one.name} and {other.name} are {100 * off_m:.1f} cm or more above or below their height in every"
            " demonstration; with their names exchanged they would not be. The estimator probably took one for the"
            " other: check the names."
        )
        if swapped := rules.OBJECTS_IN_EACH_OTHERS_PLACE.findings(off_m, message, f"objects[{one.name}]", off_m=off_m):
            return list(swapped), (one, other)
        off_m = float(np.linalg.norm(one.position_m - other.position_m))
        least_m = scenes.least_apart_m[one.name, other.name]
        if least_m > FIXED_M and off_m < apart_share * least_m:
            message = (
                f"{one.name} and {other.name} are seen {100 * off_m:.1f} cm apart, but at least {100 * least_m:.1f} cm"
                " in every demonstration. The estimator probably found one object twice."
            )
            numbers = {"apart_m": off_m, "least_m": least_m}
            return [rules.OBJECTS_IN_ONE_PLACE.finding(message, f"objects[{one.name}]", numbers)], (one, other)
    return [], ()


def _height_error_if_exchanged_m(one: ObjectPose, other: ObjectPose, scenes: ShownScenes) -> float:
    """Return the smaller of the two height errors, if exchanging the names at least halves both; else 0.

    They count if they are larger than the range of heights in demonstrations, which is noise.
    """
    places = scenes.places[one.name], scenes.places[other.name]
    noise_m = max(place.box_m.width[2] for place in places)
    off_m = min(place.lifted_m(pose) for place, pose in zip(places, (one, other), strict=True))
    if noise_m >= FIXED_M or off_m < noise_m:
        return 0.0
    left_m = max(place.lifted_m(pose) for place, pose in zip(places, (other, one), strict=True))
    return off_m if left_m < off_m / 2 else 0.0


def _noise(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> tuple[Finding, ...]:
    """Return a finding if heights and tilts that all demonstrations share are now off, as noisy poses are."""
    error_m = estimated_error_m(observed, places)
    message = (
        f"Heights and tilts differ from those in all demonstrations: poses have an error of about {100 * error_m:.1f}"
        " cm, so that grasps may miss. Check the camera's calibration and the estimator."
    )
    return rules.NOISY_OBSERVATION.findings(error_m, message, "objects", error_m=error_m)
