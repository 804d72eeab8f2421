"""The hand of a recording: gripper switches, ends, speeds and reversals, which keyframes do not show."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings.acts import Act, act_of
from app.pipeline.keyframes.motion import BLIP_S, FLICKERS_S, Motion
from app.pipeline.keyframes.rules import SIMULATION_DELTA_RAD_S
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

END_S = 0.2  # a moving hand leaves its place within this time, at the start as at the end
DIPS_M = 0.03  # a smaller range of heights is no motion to a place and back
HELD_M = 0.10  # an object as near to the first pose of the hand may be in it
MOVING_M = 0.005  # between two frames of a moving hand
SLIDES_M, LEVEL_M = 0.05, 0.02  # a hand that moves farther, within this of its lowest height, slides what it touches
# No arm makes a step so long, so many times as long as those before and after it, with so great an acceleration;
LEAP_M, LEAP, LEAP_M_S2 = 0.03, 3.0, 10.0
FAR_LEAP_M, FAR_LEAP = 0.10, 4.0  # nor one that is so long, and so many times as long as most
GAP_S, GAP = 0.5, 5.0  # a longer time between two frames, and so many times as long as usual, lacks frames
# No arm of up to 1.3 m moves its hand farther for a joint path of 1 rad (norm over the joints); what is beyond it by so
# much is no noise. In right recordings of three simulators, and of people at three arms, it is 0.2 mm at most.
M_PER_JOINT_RAD, OUTRUN_M = 1.5, 0.01

# (segment length in m, cosine of the angle between successive segments): long segments that turn back sharply are
# certainly a reversal, and anything that turns back less is possibly one.
CERTAIN, POSSIBLE = (0.04, -0.8), (0.015, -0.3)


class Kept(NamedTuple):
    """How far actions are from a recording.

    Attributes:
        missed_m: from the places where the hand acts.
        left_m: of the path through them from the recorded one, where the hand moves.
    """

    missed_m: float
    left_m: float


class Reversals(NamedTuple):
    """How often a hand reverses its direction of motion: at least `certain` times, at most `possible` times."""

    certain: int
    possible: int


def _reversals(positions_m: Array, segment_m: float, cosine: float) -> int:
    """Count the corners sharper than `cosine` in the path, resampled to steps of at least `segment_m`."""
    kept = [0]
    while (far := np.linalg.norm(positions_m[kept[-1] :] - positions_m[kept[-1]], axis=1) >= segment_m).any():
        kept.append(kept[-1] + int(far.argmax()))
    segments_m = np.diff(positions_m[kept], axis=0)
    directions = segments_m / np.linalg.norm(segments_m, axis=1, keepdims=True)
    return int(((directions[1:] * directions[:-1]).sum(axis=1) < cosine).sum())


@dataclass(frozen=True, eq=False)
class RecordedHand:
    """The hand of one recording.

    Attributes:
        kept: how closely the actions keep to it.
        starts_open: whether the fingers are open until the first act.
        acts: the switches of the gripper, without fingers that come to their place before the hand moves.
        start: its first pose.
        start_speed_m_s: in the first moments.
        acts_at: where it may act: at the first switch of the gripper, if it switches, and at its lowest place.
        end_m: (3,) where it is at last.
        end_speed_m_s: at the last frame; a hand that trembles at one place has none.
        nearest_m: the least distance from any object.
        still_comes: whether it has that distance in the last frame alone: it is on its way to the object.
        dips: whether it goes down to its lowest place and up again, as where it acts.
        slides: whether it moves on at its lowest height, as a hand that slides something.
        may_hold: the objects so near to its first pose that it may hold them from the start.
        reversals: how often it reverses its direction of motion.
        leaps: whether it is suddenly elsewhere, as where recordings are joined or frames are missing.
        flickers: whether the gripper switches to and fro faster than fingers do, though no single frame is wrong.
        outruns_joints: whether it moves farther than the recorded joints can move it.
        unturned: whether its rotation is the identity in every frame, as of a recorder that knows none.
    """

    kept: Kept
    starts_open: bool
    acts: tuple[Act, ...]
    start: EndEffectorAction
    start_speed_m_s: float
    acts_at: tuple[EndEffectorAction, ...]
    end_m: Array
    end_speed_m_s: float
    nearest_m: float
    still_comes: bool
    dips: bool
    slides: bool
    may_hold: frozenset[str]
    reversals: Reversals
    leaps: bool = False
    flickers: bool = False
    outruns_joints: bool = False
    unturned: bool = False

    @property
    def ends_holding(self) -> bool:
        """Whether it closed on an object at last; a fist that then comes nearer to the object closed on nothing."""
        return bool(self.acts) and not self.acts[-1].opens and self.acts[-1].at_object

    @classmethod
    def of(cls, motion: Motion, shown: Demonstration, kept: Kept) -> "RecordedHand":
        """Return the hand of the demonstration's recording."""
        trajectory, acting = motion.trajectory, motion.acting_switches
        objects_m = np.array([pose.position_m for pose in shown.objects])
        away_m = np.linalg.norm(trajectory.positions_m[:, None] - objects_m[None], axis=2)  # (T, N)
        ends = [0, *(switch.frame for switch in acting), len(trajectory) - 1]
        starts_open = not acting[0].opens if acting else bool(trajectory.gripper_open[-1])
        lowest = int(trajectory.positions_m[:, 2].argmin())
        nearest = int(away_m.min(axis=1).argmin())  # the first frame of the least distance
        return cls(
            kept,
            starts_open,
            tuple(act_of(motion, s, ends[k], ends[k + 2], shown, away_m) for k, s in enumerate(acting)),
            trajectory.action_at(0),
            _leaves_m_s(trajectory.positions_m, motion.times_s),
            tuple(map(trajectory.action_at, [*(s.frame for s in acting[:1]), lowest])),
            trajectory.positions_m[-1],
            min(float(motion.hand_speeds_m_s[-1]), _leaves_m_s(trajectory.positions_m[::-1], -motion.times_s[::-1])),
            float(away_m.min()),
            nearest == len(trajectory) - 1,
            min(trajectory.positions_m[[0, -1], 2]) - trajectory.positions_m[:, 2].min() > DIPS_M,
            _slides(trajectory.positions_m),
            frozenset(pose.name for pose, far_m in zip(shown.objects, away_m[0], strict=True) if far_m < HELD_M),
            Reversals(*(_reversals(trajectory.positions_m, *limits) for limits in (CERTAIN, POSSIBLE))),
            _leaps(trajectory.positions_m, motion.times_s),
            _flickers(motion),
            _outruns_joints(motion),
            quaternions.is_identity(motion.trajectory.quaternions_xyzw),
        )


def _slides(positions_m: Array) -> bool:
    low = np.flatnonzero(positions_m[:, 2] < positions_m[:, 2].min() + LEVEL_M)
    ways = np.split(low, np.flatnonzero(np.diff(low) > 1) + 1)  # what is put down elsewhere is lifted between
    return any(np.linalg.norm(np.ptp(positions_m[way, :2], axis=0)) > SLIDES_M for way in ways)


def _flickers(motion: Motion) -> bool:
    lasts_s = np.diff(motion.times_s[list(motion.gripper_changes)])
    return bool(((lasts_s > BLIP_S) & (lasts_s < FLICKERS_S)).any())


def _outruns_joints(motion: Motion) -> bool:
    """Return whether the hand is displaced by more than the joints' path allows.

    False where the joints rest in all frames, as where keyframes alone were recorded.
    """
    speeds_rad_s, positions_m = motion.joint_speeds_rad_s, motion.trajectory.positions_m
    if speeds_rad_s.max() < SIMULATION_DELTA_RAD_S:
        return False
    allowed_m = M_PER_JOINT_RAD * np.maximum(speeds_rad_s[:-1], speeds_rad_s[1:]) * np.diff(motion.times_s)
    reach_m = np.append(0.0, np.cumsum(allowed_m))
    frames = 1
    while frames < len(motion):
        way_m = np.linalg.norm(positions_m[frames:] - positions_m[:-frames], axis=1)
        if (way_m - (reach_m[frames:] - reach_m[:-frames]) > OUTRUN_M).any():
            return True
        frames *= 2
    return False


def _leaps(positions_m: Array, times_s: Array) -> bool:
    """Return whether a single step is no motion of an arm, or frames are missing in which the hand moves."""
    steps_m, steps_s = np.linalg.norm(np.diff(positions_m, axis=0), axis=1), np.diff(times_s)
    if not (steps_m > LEAP_M).any():
        return False
    around_m = np.maximum(np.append(0.0, steps_m[:-1]), np.append(steps_m[1:], 0.0))
    sudden = (steps_m > LEAP * around_m) & (steps_m - around_m > LEAP_M_S2 * steps_s**2)
    missing = steps_s > max(GAP_S, GAP * float(np.median(steps_s)))
    far = steps_m > max(FAR_LEAP_M, FAR_LEAP * float(np.quantile(steps_m[steps_m > MOVING_M], 0.9)))
    return bool((((sudden | missing) & (steps_m > LEAP_M)) | far).any())


def _leaves_m_s(positions_m: Array, times_s: Array) -> float:
    """Return the speed at which the hand leaves its first place within `END_S`."""
    last = min(max(int(np.searchsorted(times_s, times_s[0] + END_S, "right")) - 1, 1), len(times_s) - 1)
    way_m = float(np.linalg.norm(positions_m[last] - positions_m[0]))
    return way_m / max(float(times_s[last] - times_s[0]), 1e-9)
