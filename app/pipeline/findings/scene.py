"""Findings about an observed scene: uncertain poses, and objects unlike the demonstrations."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding, rules, worst_severity
from app.pipeline.findings.demonstrated_scenes import ShownScenes, arrangement_findings
from app.pipeline.findings.places import FIXED_M, MANY, MIN_DEMONSTRATIONS, ShownPlaces, estimated_error_m
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.severity import SEVERITIES

UNSURE_CONFIDENCE = 0.7  # a pose of less confidence is reported even if the estimator gives no reason
UPRIGHT_DEG = 0.5  # noise that lifts an object tilts it, too
REPEATED_M = 1e-5  # two measurements of one pose differ by more
APART_SHARE = 0.5  # of the least distance of two objects in MANY demonstrations: nearer ones are one object


def scene_findings(
    query: Query, scenes: ShownScenes, followed: frozenset[str] = frozenset(), needed: frozenset[str] | None = None
) -> tuple[Finding, ...]:
    """Return the findings, causes first; findings that a cause explains are left out unless they are severer.

    Args:
        query: the observed objects.
        scenes: the demonstrations' scenes, with the same objects; empty where they are not known.
        followed: the objects that rows of the requested motion are relative to.
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
        found += [] if pose in confused or not (needed is None or pose.name in needed) else _place(pose, of_pose)
    arranged = list(arrangement_findings(query, scenes, followed))
    arranged = [item for item in arranged if item.severity == "danger"][:1] or arranged[:1]
    found += [] if confused else _severer(arranged, found)
    found += _severer(_noise(observed, places), found)
    return (*uncertain, *found)


def rotation_findings(
    observed: Sequence[ObjectPose], scenes: ShownScenes, turning: frozenset[str]
) -> Iterator[Finding]:
    """Yield a finding for each object whose rotation nothing has measured, if rows follow its own axes.

    Poses in whole millimeters are left out: people write them by hand.

    Args:
        turning: the objects whose own axes rows of the requested motion follow.
    """
    for pose in observed if len(scenes.demonstrations) >= MIN_DEMONSTRATIONS else ():
        if pose.name in turning and scenes.places[pose.name].lacks_rotation(pose) and not _in_millimeters(pose):
            message = (
                f"The rotation of {pose.name} is exactly 0 (0, 0, 0, 1), as that of no demonstration, and the hand"
                " turns with it. The estimator probably saw no rotation: observe the scene again."
            )
            yield rules.ROTATION_NOT_MEASURED.finding(message, f"objects[{pose.name}].quaternion_xyzw")


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
    if not moved or all(map(_in_millimeters, moved)):
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
    if _in_millimeters(pose) or not _repeats(pose.position_m, places_m).any():
        return False
    return all(not _repeats(place_m, places_m[:k]).any() for k, place_m in enumerate(places_m))


def _repeats(place_m: Array, places_m: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: which of the places (N, 3) are the same measurement as a place (3,)."""
    repeats: npt.NDArray[np.bool_] = np.abs(places_m - place_m).max(axis=1) < REPEATED_M
    return repeats


def _in_millimeters(pose: ObjectPose) -> bool:
    return bool(np.abs(pose.position_m - pose.position_m.round(3)).max() < REPEATED_M)


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


def _place(pose: ObjectPose, places: ShownPlaces) -> list[Finding]:
    """Return findings for one object whose pose is outside of what was demonstrated."""
    where = f"objects[{pose.name}]"
    tilt_deg = places.tilted_beyond_deg(pose)
    message = (
        f"The tilt of {pose.name} differs by {tilt_deg:.0f} degrees from every demonstration. If it has fallen over,"
        " stand it up."
    )
    tilted = rules.OBJECT_TILTED.findings(tilt_deg, message, where, tilt_deg=tilt_deg)
    off_m = places.lifted_m(pose) if places.leans_deg(pose) < UPRIGHT_DEG else 0.0
    message = (
        f"{pose.name} is {100 * off_m:.1f} cm above or below its height in every demonstration. It is another object,"
        " or stands on something."
    )
    lifted = rules.OBJECT_AT_ANOTHER_HEIGHT.findings(off_m, message, where, off_m=off_m)
    turned = () if tilted else _turned(pose, places)  # the yaw of an object that has fallen over means nothing
    return [*tilted, *lifted, *_beyond(pose, places), *turned]


def _beyond(pose: ObjectPose, places: ShownPlaces) -> tuple[Finding, ...]:
    where = f"objects[{pose.name}]"
    if places.in_one_place:
        far_m = float(np.linalg.norm(places.box_m.outside(pose.position_m)))
        message = (
            f"{pose.name} stands {100 * far_m:.1f} cm from its place, which is the same in all demonstrations: they do"
            " not show whether the hand follows it. Put it back, or record demonstrations with it at other places."
        )
        return rules.OBJECT_OFF_ITS_ONE_PLACE.findings(far_m, message, where, beyond_m=far_m)
    off = places.off_box(pose.position_m)
    message = (
        f"{pose.name} is {100 * off.far_m:.0f} cm outside of the demonstrated range along {off.axis}, which is"
        f" {off.range_text}. Check that it is the right object; if it is, record demonstrations nearer to it."
    )
    return rules.OBJECT_BEYOND_DEMONSTRATIONS.findings(off.beyond_slack_m, message, where, beyond_m=off.far_m)


def _turned(pose: ObjectPose, places: ShownPlaces) -> tuple[Finding, ...]:
    beyond_deg, range_deg = places.turned_beyond_deg(pose)
    if rules.OBJECT_TURNED.severity(beyond_deg - 4 * range_deg / places.number) is None:
        return ()
    message = (
        f"{pose.name} is turned about the vertical by {beyond_deg:.0f} degrees beyond the demonstrations, which span"
        f" {range_deg:.0f} degrees. Turn it back, record demonstrations at this angle, or, if it looks the same after"
        " a part of a turn, set the task's yaw_symmetry_deg."
    )
    rule = rules.OBJECT_TURNED_OF_MANY if places.number >= MANY else rules.OBJECT_TURNED
    return rule.findings(beyond_deg, message, f"objects[{pose.name}]", beyond_deg=beyond_deg)


def _noise(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> tuple[Finding, ...]:
    """Return a finding if heights and tilts that all demonstrations share are now off, as noisy poses are."""
    error_m = estimated_error_m(observed, places)
    message = (
        f"Heights and tilts differ from those in all demonstrations: poses have an error of about {100 * error_m:.1f}"
        " cm, so that grasps may miss. Check the camera's calibration and the estimator."
    )
    return rules.NOISY_OBSERVATION.findings(error_m, message, "objects", error_m=error_m)
