"""What is doubtful about an observed scene, by itself and compared with those of the demonstrations.

Where demonstrations have an object says how far an observed pose is from that.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, Severity
from app.pipeline.language.mentions import mention_order
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, MEAN_LENGTH
from roboprompt_client import quaternions
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose

UP = (0.0, 0.0, 1.0)
FIXED_M = 0.01  # what varies by less is the same in all demonstrations
FIXED_DEG = 3.0
FULL_TURN_DEG = 200.0  # demonstrations over more than this have an object at any angle
ENOUGH = 3  # demonstrations from which on their places say something about what was taught
UNSURE = 0.7  # of a pose
# The thresholds below are measured: docs/results/findings.md.
BEYOND_M = 0.05  # and the share 1 / N of the range of N demonstrations
FAR_BEYOND_M = 0.30
TURNED_DEG = 10.0  # and the share 4 / N of the range
TILT_DEG = 20.0
LIFTED_M = 0.011
UPRIGHT_DEG = 0.5  # noise that lifts an object tilts it, too
NOISE_M = 0.016  # 1 cm fails seldom, 3 cm mostly
APART = 0.5  # of the least distance between two objects in demonstrations
ARRANGED_M = 0.03


@dataclass(frozen=True, eq=False)
class ShownPlaces:
    """One object in all demonstrations.

    Attributes:
        number: of the demonstrations.
        low_m, high_m: (3,) the box that holds its places.
        up: (N, 3) the directions of its z axis; empty where its rotations are not known.
        yaws_rad: (N,) of the same objects.
    """

    number: int
    low_m: Array
    high_m: Array
    up: Array
    yaws_rad: Array

    @classmethod
    def of(cls, name: str, shown: Sequence[Demonstration]) -> "ShownPlaces":
        """The places of the object in at least one demonstration."""
        poses = [demonstration.object(name) for demonstration in shown]
        places_m = np.array([pose.position_m for pose in poses])
        known = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        up = np.array([quaternions.rotated(turn, UP) for turn in known]).reshape(-1, 3)
        yaws_rad = np.array([quaternions.yaw_rad(turn) for turn in known])
        return cls(len(poses), places_m.min(axis=0), places_m.max(axis=0), up, yaws_rad)

    @property
    def range_m(self) -> Array:
        """(3,) how far the places reach along each axis."""
        reach: Array = self.high_m - self.low_m
        return reach

    def beyond_m(self, pose: ObjectPose) -> Array:
        """(3,) how far the pose lies outside of the box."""
        beyond: Array = np.maximum(pose.position_m - self.high_m, 0) + np.maximum(self.low_m - pose.position_m, 0)
        return beyond

    def lifted_m(self, pose: ObjectPose) -> float:
        """How far the pose lies above or below; 0 where demonstrations have the object at different heights."""
        return float(self.beyond_m(pose)[2]) if self.range_m[2] < FIXED_M else 0.0

    def leans_deg(self, pose: ObjectPose) -> float:
        """The angle between its z axis and that of the nearest demonstration; 0 where it is not known."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        axis = quaternions.rotated(pose.quaternion_xyzw, UP)
        return math.degrees(math.acos(float(np.clip((self.up @ axis).max(), -1, 1))))

    @property
    def is_upright(self) -> bool:
        """Whether its z axis is the same in all demonstrations."""
        return len(self.up) > 0 and float((self.up @ self.up.T).min()) > math.cos(math.radians(FIXED_DEG))

    def tilted_beyond_deg(self, pose: ObjectPose) -> float:
        """How far the object is tilted from the vertical beyond, or short of, every demonstration."""
        if pose.quaternion_xyzw is None or not len(self.up):
            return 0.0
        tilts_deg = np.degrees(np.arccos(np.clip(self.up[:, 2], -1, 1)))
        tilt_deg = math.degrees(quaternions.tilt_rad(pose.quaternion_xyzw))
        return float(max(tilts_deg.min() - tilt_deg, tilt_deg - tilts_deg.max(), 0))

    def turned_beyond_deg(self, pose: ObjectPose) -> tuple[float, float]:
        """How far the object is turned about the vertical beyond the demonstrations, and their range."""
        if pose.quaternion_xyzw is None or not len(self.yaws_rad):
            return 0.0, 0.0
        middle_rad = np.angle(np.exp(1j * self.yaws_rad).mean())
        off_deg = _wrapped_deg(self.yaws_rad - middle_rad)
        range_deg = float(np.ptp(off_deg))
        if range_deg > FULL_TURN_DEG:
            return 0.0, range_deg
        own_deg = float(_wrapped_deg(np.array(quaternions.yaw_rad(pose.quaternion_xyzw) - middle_rad)))
        return max(float(off_deg.min()) - own_deg, own_deg - float(off_deg.max()), 0.0), range_deg


@dataclass(frozen=True, eq=False)
class ShownScenes:
    """The scenes of demonstrations; what they say of an object is computed once."""

    demonstrations: tuple[Demonstration, ...]

    @cached_property
    def _places(self) -> dict[str, ShownPlaces]:
        return {}

    def places(self, name: str) -> ShownPlaces:
        """Where the object is in all of them, at least one."""
        if (places := self._places.get(name)) is None:
            places = self._places[name] = ShownPlaces.of(name, self.demonstrations)
        return places

    @cached_property
    def _least_apart_m(self) -> dict[tuple[str, str], float]:
        return {}

    def least_apart_m(self, one: str, other: str) -> float:
        """The least distance between two objects in any of them."""
        if (least_m := self._least_apart_m.get((one, other))) is None:
            least_m = min(_apart_m(d.object(one), d.object(other)) for d in self.demonstrations)
            self._least_apart_m[one, other] = least_m
        return least_m


def estimated_error_m(observed: Sequence[ObjectPose], places: Sequence[ShownPlaces]) -> float:
    """The mean error of the observed positions, from heights and tilts that are the same in all demonstrations.

    Errors are taken for Gaussian, alike along every axis, with as many degrees to a centimetre as the paper's pose
    estimator has; 0 where no height and no tilt is the same in all.
    """
    per_axis_m, per_axis_deg = MEAN_ERROR_M / MEAN_LENGTH, math.degrees(MEAN_ERROR_RAD) / MEAN_LENGTH
    squares, number = 0.0, 0
    for pose, shown in zip(observed, places, strict=True):
        if shown.range_m[2] < FIXED_M:
            squares, number = squares + (shown.lifted_m(pose) / per_axis_m) ** 2, number + 1
        if pose.quaternion_xyzw is not None and shown.is_upright:
            squares, number = squares + (shown.leans_deg(pose) / per_axis_deg) ** 2, number + 2
    return MEAN_ERROR_M * math.sqrt(squares / number) if number else 0.0


def _wrapped_deg(angles_rad: Array) -> Array:
    """The same angles from -180 to 180 degrees."""
    wrapped: Array = np.degrees((angles_rad + np.pi) % (2 * np.pi) - np.pi)
    return wrapped


def scene_findings(observed: Sequence[ObjectPose], scenes: ShownScenes, instruction: str) -> tuple[Finding, ...]:
    """What deserves a look, causes first: at most one finding for each object, and one for all of them together.

    Args:
        scenes: of the demonstrations of the prompt, with the same objects; none where they are not known.
        instruction: as the LLM reads it.
    """
    uncertain, shown = tuple(_uncertain(observed)), scenes.demonstrations
    if len(shown) < ENOUGH:
        return uncertain
    places = [scenes.places(pose.name) for pose in observed]
    found, confused = _one_place(observed, scenes)
    of_objects = [next(_place(*item), None) for item in zip(observed, places, strict=True) if item[0] not in confused]
    found += [finding for finding in of_objects if finding is not None]
    if not found:
        found += [*_noise(observed, places), *_arranged(observed, shown, instruction)][:1]
    return (*uncertain, *found)


def _uncertain(observed: Sequence[ObjectPose]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE or pose.reason:
            reason = f": {pose.reason}" if pose.reason else ""
            message = f"The pose of {pose.name} is not certain ({pose.estimator}, {pose.confidence:.2f}){reason}."
            severity: Severity = "warning" if pose.confidence < UNSURE else "info"
            numbers = {"confidence": pose.confidence}
            yield Finding("uncertain-pose", severity, message, f"objects[{pose.name}]", numbers)


def _one_place(observed: Sequence[ObjectPose], scenes: ShownScenes) -> tuple[list[Finding], tuple[ObjectPose, ...]]:
    """Two objects that an estimator took for one, which explains whatever else is odd about them."""
    for one, other in combinations(observed, 2):
        apart_m = _apart_m(one, other)
        least_m = scenes.least_apart_m(one.name, other.name)
        if least_m > FIXED_M and apart_m < APART * least_m:
            message = (
                f"{one.name} and {other.name} are seen {100 * apart_m:.1f} cm apart, in no demonstration less than"
                f" {100 * least_m:.1f} cm: one is taken for the other."
            )
            numbers = {"apart_m": apart_m, "least_m": least_m}
            return [Finding("objects-in-one-place", "danger", message, f"objects[{one.name}]", numbers)], (one, other)
    return [], ()


def _apart_m(one: ObjectPose, other: ObjectPose) -> float:
    return float(np.linalg.norm(one.position_m - other.position_m))


def _place(pose: ObjectPose, places: ShownPlaces) -> Iterator[Finding]:
    """Beyond the demonstrations nobody has shown that the rows hold; the most telling doubt first."""
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


def _arranged(observed: Sequence[ObjectPose], shown: Sequence[Demonstration], instruction: str) -> Iterator[Finding]:
    """Objects that the instruction names stand to each other as in every demonstration, whichever they are."""
    asked = mention_order([pose.name for pose in observed], instruction)
    named = [mention_order([pose.name for pose in d.objects], d.instruction) for d in shown]
    if any(len(names) != len(asked) for names in named):
        return
    poses = {pose.name: pose for pose in observed}
    for i, j in combinations(range(len(asked)), 2):
        ways_m = np.array(
            [d.object(n[i]).position_m - d.object(n[j]).position_m for d, n in zip(shown, named, strict=True)]
        )
        way_m = poses[asked[i]].position_m - poses[asked[j]].position_m
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
