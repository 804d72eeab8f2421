"""Findings about the pose of one observed object: outside of what was demonstrated, or not measured."""

import numpy as np

from app.pipeline.findings import Finding, rules
from app.pipeline.findings.places import MANY, ShownPlaces
from roboprompt_client.types.poses import ObjectPose

UPRIGHT_DEG = 0.5  # noise that lifts an object tilts it, too
IRRELEVANT_DEG = 60.0  # a hand that does not turn with an object whose yaws span more need not do so at further ones
REPEATED_M = 1e-5  # two measurements of one pose differ by more


def pose_findings(pose: ObjectPose, places: ShownPlaces, *, turns: bool) -> list[Finding]:
    """Return findings for one object whose pose is outside of what was demonstrated.

    Args:
        turns: whether the hand, or its place, turns with it.
    """
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
    turned = () if tilted else _turned(pose, places, turns)  # the yaw of an object that has fallen over means nothing
    unmeasured = _unmeasured(pose) if turns and places.lacks_rotation(pose) else ()
    return [*tilted, *lifted, *_beyond(pose, places), *turned, *unmeasured]


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


def _turned(pose: ObjectPose, places: ShownPlaces, turns: bool) -> tuple[Finding, ...]:
    beyond_deg, range_deg = places.turned_beyond_deg(pose)
    if rules.OBJECT_TURNED.severity(beyond_deg - 4 * range_deg / places.number) is None:
        return ()
    message = (
        f"{pose.name} is turned about the vertical by {beyond_deg:.0f} degrees beyond the demonstrations, which span"
        f" {range_deg:.0f} degrees. Turn it back, record demonstrations at this angle, or, if it looks the same after"
        " a part of a turn, set the task's yaw_symmetry_deg."
    )
    rule = rules.OBJECT_TURNED_OF_MANY if places.number >= MANY else rules.OBJECT_TURNED
    if not turns and range_deg > IRRELEVANT_DEG:
        rule = rules.OBJECT_TURNED_ALONE
    return rule.findings(beyond_deg, message, f"objects[{pose.name}]", beyond_deg=beyond_deg)


def _unmeasured(pose: ObjectPose) -> tuple[Finding, ...]:
    """Return a finding about a rotation of exactly 0, but not of a pose that was written by hand."""
    if in_millimeters(pose):
        return ()
    message = (
        f"The rotation of {pose.name} is exactly 0 (0, 0, 0, 1), as that of no demonstration, and the hand turns with"
        " it. The estimator probably saw no rotation: observe the scene again."
    )
    return (rules.ROTATION_NOT_MEASURED.finding(message, f"objects[{pose.name}].quaternion_xyzw"),)


def in_millimeters(pose: ObjectPose) -> bool:
    """Return whether the position is in whole millimeters, as people write it by hand."""
    return bool(np.abs(pose.position_m - pose.position_m.round(3)).max() < REPEATED_M)
