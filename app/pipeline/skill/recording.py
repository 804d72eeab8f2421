"""Recordings aligned into rows: the arrays that a skill is fitted to."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import Keyframe, KeyframeRule, Motion, find_keyframes, manner_of, waypoints
from app.pipeline.keyframes.resting import leave_path, path_left_m
from app.pipeline.keyframes.rules import MAX_KEYFRAMES, at_tips, best_waypoints
from app.pipeline.names import folded_name
from app.pipeline.order.order import Order
from app.pipeline.skill.scene import UNKNOWN_PLACE, UNKNOWN_TURN, Scene
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

PATH_KEPT_SHARE = 0.8  # of the demonstrations: their paths need no more rows
TOGETHER = 0.3  # weight of demonstrations being alike against the deviation from the path: swept on Meta-World's half
FAR = 3.0  # tolerances: larger distances between demonstrations cost no more
TURNS_BACK = 0.5  # cosine between the way to a row and the way from it, beyond which the hand turns back there
LOWEST_M = 0.01  # rows this near to the lowest act, too,
LEVEL_M = 0.03  # unless all rows lie within this height
STEP_M = 0.02  # ways shorter than this have no direction


@dataclass(frozen=True, eq=False)
class Recording:
    """A demonstration: its motion, and the scene at its first frame.

    Attributes:
        rule: by which keyframes are found.
    """

    motion: Motion
    scene: Scene
    demonstration: Demonstration
    rule: KeyframeRule = KeyframeRule()  # noqa: RUF009  it is frozen

    @classmethod
    def of(
        cls,
        demonstration: Demonstration,
        motion: Motion,
        symmetry: Mapping[str, float] | None = None,
        rule: KeyframeRule | None = None,
    ) -> "Recording":
        """Return the recording of a demonstration; the hand starts where its first frame has it."""
        shown = replace(demonstration, start=motion.trajectory.action_at(0))
        return cls(motion, Scene.of(shown, symmetry), shown, rule or KeyframeRule())

    @property
    def order(self) -> Order:
        """The instruction as a value."""
        return self.demonstration.order

    @property
    def id(self) -> str:
        """The demonstration's, by which doubts name it."""
        return self.demonstration.id

    def only(self, names: Collection[str]) -> "Recording":
        """Return the recording with only those objects that have these names."""
        shown = self.demonstration.only(names)
        if shown is self.demonstration:
            return self
        kept = {folded_name(pose.name) for pose in shown.objects}
        keys = [key for key, name in zip(self.scene.keys, self.scene.names, strict=True) if name in kept]
        return replace(self, demonstration=shown, scene=self.scene.only(keys))

    @cached_property
    def without_start(self) -> "Recording":
        """The recording as if nobody told where the hand starts, so that no row follows that."""
        scene = replace(self.scene, start=UNKNOWN_PLACE, start_turn=UNKNOWN_TURN)
        return replace(self, demonstration=replace(self.demonstration, start=None), scene=scene)

    @cached_property
    def rests(self) -> bool:
        """Whether the hand rests at its keyframes."""
        return self.rule.rule != "waypoints" and manner_of(self.motion, self.rule.delta_rad_s) == "rests"

    @cached_property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes by its rule."""
        return find_keyframes(self.motion, self.rule)

    @cached_property
    def waypoints(self) -> tuple[Keyframe, ...]:
        """The keyframes that its path needs, whether the hand rests or not."""
        return waypoints(self.motion, self.rule.tolerance_m, self.rule.tolerance_deg)

    @cached_property
    def signature(self) -> tuple[bool, ...]:
        """The states of the gripper in order."""
        phases = self.motion.phases
        return (phases[0].gripper_open, *(phase.ends_open for phase in phases))

    @cached_property
    def passed_m(self) -> dict[str, float]:
        """How near the hand came to each object, by name, to where it stood at first."""
        way = self.motion.trajectory.positions_m
        return {
            name: float(np.linalg.norm(way - place, axis=1).min())
            for name, place in zip(self.scene.names, self.scene.place, strict=True)
        }


@dataclass(frozen=True, eq=False)
class Rows:
    """N recordings with R rows each.

    Attributes:
        scenes: (N) at their first frames, with the objects that all have.
        frames: (N, R) of the recordings.
        hand, turn: (N, R, 3) m and (N, R, 4) there.
        gripper_open: (R,) what the gripper does there.
        before: whether it is open at the start.
        first, first_turn: (N, 3) m and (N, 4) where the hands start.
    """

    scenes: Scene
    frames: npt.NDArray[np.int_]
    hand: Array
    turn: Array
    gripper_open: npt.NDArray[np.bool_]
    before: bool
    first: Array
    first_turn: Array

    def __len__(self) -> int:
        return len(self.gripper_open)

    @property
    def number(self) -> int:
        """How many recordings there are."""
        return len(self.hand)

    @cached_property
    def switches(self) -> tuple[int, ...]:
        """The rows at which the gripper opens or closes."""
        states = [self.before, *self.gripper_open.tolist()]
        return tuple(k for k in range(len(self)) if states[k] != states[k + 1])

    @cached_property
    def acts(self) -> tuple[int, ...]:
        """The rows in which the hand acts: where the gripper switches; else also where it is lowest or turns back."""
        if len(self.switches) > 1:
            return self.switches
        heights = np.median(self.hand[..., 2], axis=0)
        way = np.diff(self.hand, axis=1)
        length = np.maximum(np.linalg.norm(way, axis=2), STEP_M)
        cosine = np.median((way[:, 1:] * way[:, :-1]).sum(2) / (length[:, 1:] * length[:, :-1]), axis=0)
        back = (np.flatnonzero(cosine < -TURNS_BACK) + 1).tolist()
        low = [] if np.ptp(heights) < LEVEL_M else np.flatnonzero(heights < heights.min() + LOWEST_M).tolist()
        return tuple(sorted({*self.switches, *back, *low})) or tuple(range(len(self)))

    def taking(self, rows: Sequence[int]) -> "Rows":
        """Return these rows only."""
        kept = list(rows)
        few = {name: getattr(self, name)[:, kept] for name in ("frames", "hand", "turn")}
        return replace(self, gripper_open=self.gripper_open[kept], **few)

    def turned(self, scenes: Scene, turn: Array) -> "Rows":
        """Return the same rows with hands and objects seen from other sides."""
        return replace(self, scenes=scenes, turn=turn)


def at_keyframes(demonstrations: Sequence[Demonstration], scenes: Sequence[Scene]) -> Rows:
    """Return demonstrations with equally many actions as they are, in the scenes of their first frames."""
    number, actions = len(demonstrations[0].actions), [item.actions for item in demonstrations]
    keys = _shared_keys(scenes)
    states = np.array([[action.gripper_open for action in own] for own in actions]).reshape(-1, number)
    is_open = 2 * states.sum(axis=0) >= len(actions)
    return Rows(
        Scene.stacked(scenes, keys),
        np.zeros((len(actions), number), dtype=int),
        np.array([[action.position_m for action in own] for own in actions]).reshape(-1, number, 3),
        np.array([[action.quaternion_xyzw for action in own] for own in actions]).reshape(-1, number, 4),
        is_open,
        before=True,
        first=np.array([scene.start for scene in scenes]),
        first_turn=np.array([scene.start_turn for scene in scenes]),
    )


def _shared_keys(scenes: Sequence[Scene]) -> list[str]:
    """Return the keys that all scenes have, those that words name first."""
    shared = set.intersection(*(set(scene.keys) for scene in scenes))
    return sorted(shared, key=lambda key: (not key.startswith("<"), key))


Costs = Callable[[int, int, npt.NDArray[np.int_]], Array]
"""From recording, row and frames: distances of the hand in these from the row, in tolerances."""


def aligned(recordings: Sequence[Recording], counts: Sequence[int], costs: Costs | None = None) -> Rows:
    """Return recordings of one signature with so many rows in each phase."""
    found = [_frames(item, n, counts, costs) for n, item in enumerate(recordings)]
    phases = recordings[0].motion.phases
    is_open = np.repeat([phase.gripper_open for phase in phases], counts)
    is_open[np.cumsum(counts) - 1] = [phase.ends_open for phase in phases]
    scenes = [item.scene for item in recordings]
    trajectories = [item.motion.trajectory for item in recordings]
    return Rows(
        Scene.stacked(scenes, _shared_keys(scenes)),
        np.array(found),
        np.array([given.positions_m[frames] for given, frames in zip(trajectories, found, strict=True)]),
        np.array([given.quaternions_xyzw[frames] for given, frames in zip(trajectories, found, strict=True)]),
        is_open,
        phases[0].gripper_open,
        np.array([given.positions_m[0] for given in trajectories]),
        np.array([given.quaternions_xyzw[0] for given in trajectories]),
    )


def counts_of(recordings: Sequence[Recording]) -> tuple[tuple[int, ...], bool]:
    """Return how many rows each phase gets, and whether they are where the recordings rest."""
    counts = [_counts(item) for item in recordings]
    resting = 2 * sum(item.rests for item in recordings) > len(recordings)
    if resting:
        numbers = Counter(counts).most_common(1)[0][0]
        if not leave_path(_left_m(recordings, aligned(recordings, numbers))):
            return numbers, True
        paths = [_by_phase(item.motion, item.waypoints) for item in recordings]
        counts = [path or own for path, own in zip(paths, counts, strict=True)]
    most = [int(np.ceil(np.quantile(column, PATH_KEPT_SHARE))) for column in zip(*counts, strict=True)]
    while sum(most) > max(MAX_KEYFRAMES, len(most)):
        most[int(np.argmax(most))] -= 1
    return tuple(most), False


def _left_m(recordings: Sequence[Recording], rows: Rows) -> list[float]:
    """Return how far each recording's approaches leave straight motion through its rows."""
    grippers = rows.gripper_open.tolist()
    plans = [EndEffectorAction.many(rows.hand[n], rows.turn[n], grippers) for n in range(rows.number)]
    return [path_left_m(item.motion, "rests", plan) for item, plan in zip(recordings, plans, strict=True)]


def _counts(item: Recording) -> tuple[int, ...]:
    found = _by_phase(item.motion, item.keyframes) or _by_phase(item.motion, item.waypoints)
    return found or (1,) * len(item.motion.phases)


def _by_phase(motion: Motion, keyframes: Sequence[Keyframe]) -> tuple[int, ...] | None:
    """Return how many keyframes each phase has; None where they show other switches than the motion has."""
    counts, state = [0], motion.phases[0].gripper_open
    for keyframe in keyframes:
        counts[-1] += 1
        if keyframe.gripper_open != state:
            counts.append(0)
            state = keyframe.gripper_open
    counts = counts if counts[-1] else counts[:-1]
    return tuple(counts) if len(counts) == len(motion.phases) else None


def _frames(item: Recording, n: int, counts: Sequence[int], costs: Costs | None) -> list[int]:
    motion, rule = item.motion, item.rule
    if costs is None and item.rests and _by_phase(motion, item.keyframes) == tuple(counts):
        return [keyframe.frame for keyframe in item.keyframes]
    found: list[int] = []
    for phase, number in zip(motion.phases, counts, strict=True):
        if number == 1:
            found.append(phase.last)
            continue
        path = motion.path(phase.first, phase.last, rule.tolerance_m, rule.tolerance_deg)
        alike = None
        if costs is not None:
            off = np.array([costs(n, k, path.frames) for k in range(len(found), len(found) + number)])
            alike = TOGETHER * np.minimum(off, FAR) ** 2
        frames = [int(path.frames[k]) for k in best_waypoints(path.deviations, number, alike)]
        if costs is None:
            frames = at_tips(motion.trajectory.positions_m, phase.first, frames, rule.tolerance_m)
        found += frames
    return found
