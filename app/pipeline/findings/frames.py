"""Findings about poses that are measured in different ways in the scene and in demonstrations.

Objects: given, or found in images. The hand: at the flange or at the fingertips, in the base frame or in the world;
recordings then start at a constant offset from `end_effector`.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.demonstrated_scenes import ShownScenes
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.places import AT_M, MIN_DEMONSTRATIONS, beside_m, spread_m
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose, Pose

GIVEN = "given"
SAME_M, SAME_DEG = 0.015, 15.0  # a given and a found pose that differ by less use the same object frame
COPIED_M = 0.001  # a given pose this near to a demonstration's was read from that demonstration

TILT_DEG = 5.0  # the hand's z axes differ by less; its rotation about z does not count, as flanges are often turned
ALONG_M, ACROSS_M = 0.04, 0.015  # the least distance of flange and fingertips along z, and the most across it
VARY = 2.0  # times the spread of starts across z: a robot does not always start in one place
BESIDE_M = 0.035  # from the nearest object's vertical axis: the hand acts beside it
NOT_AT_M = 0.20  # what is farther from the hand is not in it
SAME_PLACE_M, TURNED_DEG = 0.02, 20.0  # hands at one place that are all turned alike, by more, have other axes


@dataclass(frozen=True)
class Compared:
    """An object in an episode that has both a given pose and images in which the object was found.

    Attributes:
        turn_deg: the turn about its z axis that leaves it unchanged: 0 any, None none.
    """

    given: ObjectPose
    found: ObjectPose
    turn_deg: float | None = None

    @property
    def off_m(self) -> float:
        """The distance between the two positions."""
        return float(np.linalg.norm(self.given.position_m - self.found.position_m))

    @property
    def off_deg(self) -> float:
        """The least angle between the two rotations under the symmetry; 0 where one is not known."""
        if self.given.quaternion_xyzw is None or self.found.quaternion_xyzw is None:
            return 0.0
        between = Rotation.from_quat(self.given.quaternion_xyzw).inv() * Rotation.from_quat(self.found.quaternion_xyzw)
        if self.turn_deg == 0:
            return float(np.degrees(np.arccos(np.clip(between.as_matrix()[2, 2], -1, 1))))
        turns = Rotation.from_euler("z", np.arange(0, 360, self.turn_deg or 360)[:, None], degrees=True)
        return float(np.degrees((between * turns).magnitude().min()))

    @property
    def agrees(self) -> bool:
        """Whether both use the same object frame."""
        return self.off_m <= SAME_M and self.off_deg <= SAME_DEG


def source_findings(
    observed: Sequence[ObjectPose], shown: Sequence[Demonstration], compared: Sequence[Compared]
) -> Iterator[Finding]:
    """Yield a finding for each object whose pose is from another source, unless an episode shows that both agree."""
    for pose in observed:
        taught = [item for one in shown for item in one.objects if item.name == pose.name]
        sources = {item.estimator for item in taught} - {pose.estimator}
        repeated = any(np.linalg.norm(pose.position_m - item.position_m) < COPIED_M for item in taught)
        if not sources or (repeated and pose.estimator == GIVEN):  # it is a demonstration's pose
            continue
        measured = [item for item in compared if item.given.name == pose.name]
        if not measured or not all(item.agrees for item in measured):
            yield _other_source(pose, sources, measured)


def _other_source(pose: ObjectPose, sources: set[str], measured: Sequence[Compared]) -> Finding:
    now = "was given" if pose.estimator == GIVEN else f"was found in images ({pose.estimator})"
    then = " or ".join("given" if source == GIVEN else f"found in images ({source})" for source in sorted(sources))
    message = f"The pose of {pose.name} {now}, those of demonstrations were {then}: "
    numbers = {}
    if measured:
        off_m, off_deg = max(item.off_m for item in measured), max(item.off_deg for item in measured)
        numbers = {"off_m": off_m, "off_deg": off_deg}
        message += (
            f"where episodes have both, they differ by up to {100 * off_m:.1f} cm and {off_deg:.0f} degrees. Give poses"
            " of the same point and axes of the object, or use one source for all."
        )
    else:
        message += (
            "whether both use the same point and axes of the object is unknown. Upload an episode with a given pose and"
            " images with color and depth to compare them."
        )
    worse = bool(measured) or pose.estimator != GIVEN
    return rules.POSES_OF_ANOTHER_SOURCE.finding(message, f"objects[{pose.name}]", numbers, value=float(worse))


def start_findings(now: Pose | None, scenes: ShownScenes) -> tuple[Finding, ...]:
    """Return a finding if the hand is outside of the demonstrated starts, for a motion with rows relative to these."""
    if now is None or len(scenes.demonstrations) < MIN_DEMONSTRATIONS or scenes.starts is None:
        return ()
    off = scenes.starts.off_box(np.array(now.position_m))
    message = (
        f"The end effector is {100 * off.far_m:.0f} cm outside of the demonstrated starts along {off.axis}, which are"
        f" {off.range_text}, and the motion is relative to its start. Send `end_effector` in the world frame, or move"
        " the hand to where demonstrations start."
    )
    return rules.START_BEYOND_DEMONSTRATIONS.findings(off.beyond_slack_m, message, "end_effector", beyond_m=off.far_m)


def frame_findings(
    now: Pose | None, shown: Sequence[Demonstration], hands: Sequence[RecordedHand]
) -> Iterator[Finding]:
    """Yield findings for recordings whose hand pose differs from `now` by a constant offset rather than a motion.

    The offset is along the hand's own z axis, a turn about it, or the one by which the hand acts beside every object.

    Args:
        now: the present pose of the end effector; None where it is not known.
        shown: demonstrations, with their `hands`.
    """
    if now is None or len(hands) < MIN_DEMONSTRATIONS:
        return
    ways_m = np.array(now.position_m) - [hand.start.position_m for hand in hands]
    far_m = np.linalg.norm(ways_m, axis=1)
    axis = quaternions.rotated(now.quaternion_xyzw, (0, 0, 1))
    axes = np.array([quaternions.rotated(hand.start.quaternion_xyzw, (0, 0, 1)) for hand in hands])
    alike = axes @ axis > np.cos(np.radians(TILT_DEG))
    along = _along(ways_m, axis, shown, hands)
    turned_deg = np.array([_turned_deg(now, hand.start.quaternion_xyzw) for hand in hands])
    usual_deg = float(np.median(turned_deg))
    turned = (far_m < SAME_PLACE_M) & (abs(usual_deg) > TURNED_DEG) & (np.abs(turned_deg - usual_deg) < TILT_DEG)
    beside = [
        not along[k] and far_m[k] > ACROSS_M and _acts_beside(*item)
        for k, item in enumerate(zip(ways_m, shown, hands, strict=True))
    ]
    how = "straight along the hand's own axis. One is the flange's pose and the other the fingertips'"
    yield from _in_another_frame(how, alike & along, np.abs(ways_m @ axis))
    how = "and it acts as far beside an object, on the same side. One is in another frame, or another point of the hand"
    yield from _in_another_frame(how, alike & beside, far_m)
    how = f"in the same place, but turned about the hand's own axis by {abs(usual_deg):.0f} degrees"
    yield from _in_another_frame(how, alike & turned, far_m)


def held_findings(
    now: Pose | None, scene: Query, shown: Sequence[Demonstration], hands: Sequence[RecordedHand]
) -> Iterator[Finding]:
    """Yield a finding if recordings start with an object in the hand, or closed at it, and it is not there now."""
    if now is None or not hands:
        return
    held = Counter(
        one.order.placeholder(name)
        for one, hand in zip(shown, hands, strict=True)
        if not hand.starts_open and (not hand.acts or hand.acts[0].opens)
        for name in hand.may_hold
    )
    for pose in scene.objects:
        share = held[scene.order.placeholder(pose.name)] / len(hands)
        far_m = float(np.linalg.norm(pose.position_m - now.position_m))
        if far_m > NOT_AT_M and rules.NOT_IN_THE_HAND.severity(share) is not None:
            message = (
                f"Recordings start with {pose.name} in the hand or at it, and the hand is {100 * far_m:.0f} cm from it"
                " now. Put it into the hand, or record how the hand gets to it."
            )
            yield rules.NOT_IN_THE_HAND.finding(message, f"objects[{pose.name}]", {"share": share}, value=share)
            return


def _in_another_frame(how: str, off: Array, off_m: Array) -> Iterator[Finding]:
    share = float(off.mean())
    if rules.HAND_IN_ANOTHER_FRAME.severity(share) is not None:
        message = (
            f"In {off.sum()} of {len(off)} recordings the hand starts {100 * float(np.median(off_m[off])):.0f} cm from"
            f" `end_effector`, {how}: record and report the same point in the same frame. If the hand is elsewhere now,"
            " move it to where recordings start and ask again."
        )
        yield rules.HAND_IN_ANOTHER_FRAME.finding(message, "end_effector", {"share": share}, value=share)


def _turned_deg(now: Pose, start_xyzw: Array) -> float:
    """Return the angle about the hand's axis, from -90 to 90: fingers that are turned by 180 degrees are the same."""
    turn = quaternions.product(quaternions.inverse(np.array(now.quaternion_xyzw)), start_xyzw)
    return float((np.degrees(quaternions.to_rotation_vector(turn)[2]) + 90) % 180 - 90)


def _along(
    ways_m: Array, axis: Array, shown: Sequence[Demonstration], hands: Sequence[RecordedHand]
) -> npt.NDArray[np.bool_]:
    """Return (N,) whether the ways (N, 3) from recorded starts to the hand are along its axis, as from a flange.

    Robots that start in several places are beside that axis, too: the way must then bring the hand nearer to objects.
    """
    along_m = np.abs(ways_m @ axis)
    across = ways_m - (ways_m @ axis)[:, None] * axis
    across_m, vary_m = np.linalg.norm(across, axis=1), VARY * spread_m(across)
    found: npt.NDArray[np.bool_] = (along_m > ALONG_M) & (across_m < ACROSS_M)
    for k in np.flatnonzero((along_m > max(ALONG_M, vary_m)) & ~found & (across_m < vary_m)).tolist():
        found[k] = _acts_nearer(ways_m[k], shown[k], hands[k])
    return found


def _acts_nearer(way_m: Array, shown: Demonstration, hand: RecordedHand) -> bool:
    """Return whether the hand would act nearer to objects at another point of it, `way_m` away at the start."""
    in_hand = quaternions.rotated(quaternions.inverse(hand.start.quaternion_xyzw), way_m)
    acts_m = np.array([at.position_m for at in hand.acts_at]).reshape(-1, 3)
    moved_m = acts_m + [quaternions.rotated(at.quaternion_xyzw, in_hand) for at in hand.acts_at]
    objects_m = np.array([pose.position_m for pose in shown.objects])
    before_m, after_m = (
        np.linalg.norm(places_m[:, None] - objects_m, axis=2).min(axis=1) for places_m in (acts_m, moved_m)
    )
    return bool(after_m.sum() < before_m.sum())


def _acts_beside(way_m: Array, shown: Demonstration, hand: RecordedHand) -> bool:
    """Return whether the hand acts beside all objects, and would act at one if it was moved by `way_m`.

    The way turns with the hand if another point of it is meant, and does not if another frame of the world is.
    """
    for at in hand.acts_at:
        in_hand = quaternions.rotated(quaternions.inverse(hand.start.quaternion_xyzw), way_m)
        moved_m = at.position_m + np.array([way_m, quaternions.rotated(at.quaternion_xyzw, in_hand)])
        if beside_m(at.position_m[None], shown)[0] > BESIDE_M and beside_m(moved_m, shown).min() < AT_M:
            return True
    return False
