"""What is doubtful about actions, and about the demonstrations that a prompt shows.

Rows whose doubts share a cause are one finding. Demonstrations are doubted as far as they bear on the scene at hand.
The size of objects is not known: how near to an object demonstrated hands came says what was enough.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding, Severity
from app.pipeline.findings.places import MIN_DEMONSTRATIONS
from app.pipeline.plans.rows import BEYOND_NOISE_M, acting_rows
from app.pipeline.plans.support import PlacedPlan
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction

MAX_LISTED = 4  # numbers of actions that a sentence lists
SCATTER_M = 0.01
CENTRE_OFF_M = 0.012  # as much as pose estimators err without harm; measured: docs/results/findings.md
NEAR_M = 0.08  # about half the width of a hand
NEARER, NEARER_M = 0.5, 0.03  # than every demonstrated hand: times its distance, and by this at least
HITS_M = 0.03  # nearer to its centre a hand meets whatever has a size


@dataclass(frozen=True)
class ActionDoubt:
    """An action that is not where demonstrations have it.

    Attributes:
        index: of the action, from 0.
        off_m, off_deg: how far it lies beyond the farthest demonstration.
        seen_from: what it is relative to.
        unsupported: why it is so far off that it is refused unless the request lets it pass; None if it is not.
    """

    index: int
    off_m: float = 0.0
    off_deg: float = 0.0
    seen_from: str = ""
    unsupported: UnsupportedActionError | None = None


def action_findings(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    """At most one finding for all actions that demonstrations do not support, and one for those that stray."""
    unsupported = [doubt for doubt in doubts if doubt.unsupported is not None]
    straying = [doubt for doubt in doubts if doubt.unsupported is None]
    return (*_unsupported(unsupported), *_straying(straying))


def _unsupported(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    if not doubts:
        return ()
    first = doubts[0].unsupported
    message = f"{first}."
    if len(doubts) > 1:
        message = f"{_named(doubts)} are unlike the demonstrations; the first: {first}."
    numbers = {"num_actions": len(doubts)}
    return (Finding("unsupported-action", "danger", message, f"actions[{doubts[0].index}]", numbers),)


def _straying(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    if not doubts:
        return ()
    off_m, off_deg = max(doubt.off_m for doubt in doubts), max(doubt.off_deg for doubt in doubts)
    worst = max(doubts, key=lambda doubt: doubt.off_m)
    message = (
        f"{_named(doubts)} {'lies' if len(doubts) == 1 else 'lie'} up to {100 * off_m:.1f} cm and {off_deg:.0f} degrees"
        f" beyond where the demonstrations have them, seen from {worst.seen_from}."
    )
    numbers = {"num_actions": len(doubts), "off_m": off_m, "off_deg": off_deg}
    return (Finding("straying-action", "info", message, f"actions[{doubts[0].index}]", numbers),)


def _named(doubts: Sequence[ActionDoubt]) -> str:
    numbers = [str(doubt.index + 1) for doubt in doubts]
    if len(numbers) == 1:
        return f"Action {numbers[0]}"
    if len(numbers) > MAX_LISTED:
        return f"Actions {', '.join(numbers[:MAX_LISTED])} and {len(numbers) - MAX_LISTED} more"
    return f"Actions {', '.join(numbers[:-1])} and {numbers[-1]}"


def scatter_findings(plans: Sequence[PlacedPlan]) -> Iterator[Finding]:
    """Where the gripper acts, demonstrations that scatter say that poses are noisy or an object is missing.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off; beyond all noise
    they show no centre, and the number of demonstrations makes up for nothing.
    """
    acting = [(k, plan[k]) for plan in plans for k in acting_rows(plan)]
    scattered = [item for item in acting if item[1].scatter_m > SCATTER_M]
    if not scattered:
        return
    k, row = max(scattered, key=lambda item: (item[1].scatter_m > BEYOND_NOISE_M, item[1].centre_off_m))
    severity: Severity = "warning" if row.centre_off_m > CENTRE_OFF_M else "info"
    cause = "poses are noisy, or what it follows is not among the objects."
    if row.scatter_m > BEYOND_NOISE_M:
        severity = "danger"
        cause = "no noise does that. They do it in several ways, or what it follows is not among the objects."
    seen_from = row.anchor.object_name or row.anchor.frame
    message = (
        f"{row.number} demonstrations scatter by {100 * row.scatter_m:.1f} cm where the gripper acts (action {k + 1},"
        f" seen from {seen_from}), and their centre may be {100 * row.centre_off_m:.1f} cm off: {cause}"
    )
    numbers = {"scatter_m": row.scatter_m, "centre_off_m": row.centre_off_m}
    yield Finding("scattered-demonstrations", severity, message, f"actions[{k}]", numbers)


@dataclass(frozen=True, eq=False)
class ShownWays:
    """How near the hands of demonstrations came to their objects; computed once."""

    demonstrations: tuple[Demonstration, ...]

    def least_m(self, name: str, mentioned: Sequence[str]) -> float | None:
        """The least distance from an object, or from what has its place in the instruction; None if nothing has.

        Args:
            mentioned: by the instruction, in its order.
        """
        if name not in mentioned:
            return self._of_name.get(name)
        place = mentioned.index(name)
        return self._of_place[place] if place < len(self._of_place) else None

    @cached_property
    def _of_name(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for least_m in self._least_m:
            for name, distance_m in least_m.items():
                found[name] = min(distance_m, found.get(name, distance_m))
        return found

    @cached_property
    def _of_place(self) -> tuple[float, ...]:
        columns: list[list[float]] = []
        for demonstration, least_m in zip(self.demonstrations, self._least_m, strict=True):
            for place, name in enumerate(demonstration.order.objects if least_m else ()):
                if place == len(columns):
                    columns.append([])
                columns[place].append(least_m[name])
        return tuple(min(column) for column in columns)

    @cached_property
    def _least_m(self) -> tuple[dict[str, float], ...]:
        return tuple(_least_m(demonstration) for demonstration in self.demonstrations)


def _least_m(demonstration: Demonstration) -> dict[str, float]:
    """The least distance of the hand from each object; of a hand that goes nowhere from none."""
    if not demonstration.actions:
        return {}
    way_m = way(demonstration.start, demonstration.actions)
    return {pose.name: float(distances_m(way_m, pose.position_m).min()) for pose in demonstration.objects}


def way(start: EndEffectorAction | None, actions: Sequence[EndEffectorAction]) -> Array:
    """(P, 3) the positions that the hand goes to in turn, straight from one to the next."""
    poses = actions if start is None else (start, *actions)
    return np.array([pose.position_m for pose in poses])


def distances_m(way_m: Array, place_m: Array) -> Array:
    """(P,) of a place from the straight motion to each position of a way; the first is where it begins."""
    before_m = np.concatenate([way_m[:1], way_m[:-1]])
    gone_m, to_place_m = way_m - before_m, place_m - before_m
    squared = np.maximum(np.einsum("pk,pk->p", gone_m, gone_m), 1e-12)
    share = np.clip(np.einsum("pk,pk->p", to_place_m, gone_m) / squared, 0, 1)
    distances: Array = np.linalg.norm(to_place_m - share[:, None] * gone_m, axis=1)
    return distances


def passing_findings(query: Query, actions: Sequence[EndEffectorAction], shown: ShownWays) -> Iterator[Finding]:
    """What the hand passes by far nearer than any demonstrated hand did; one finding for each such object.

    Args:
        query: the objects as they were observed, and where the hand is before the first action, if that is known.
    """
    if len(shown.demonstrations) < MIN_DEMONSTRATIONS or not actions:
        return
    way_m = way(query.start, actions)
    for pose in query.objects:
        least_m, all_m = shown.least_m(pose.name, query.order.objects), distances_m(way_m, pose.position_m)
        near_m = float(all_m.min())
        if least_m is None or near_m > min(NEAR_M, NEARER * least_m, least_m - NEARER_M):
            continue
        number = max(0, int(all_m.argmin()) - (query.start is not None))
        severity: Severity = "danger" if near_m < HITS_M else "warning"
        message = (
            f"On the way to action {number + 1} the hand passes {100 * near_m:.1f} cm from the centre of {pose.name!r};"
            f" demonstrations kept {100 * least_m:.1f} cm away. The hand, or what it holds, may hit it."
        )
        numbers = {"distance_m": near_m, "demonstrated_m": least_m, "action": number}
        yield Finding("passes-close", severity, message, f"objects[{pose.name}]", numbers)
