"""What is doubtful about actions: rows whose doubts share a cause are one finding.

The size of objects is not known: how near to an object demonstrated hands came says what was enough.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.findings.places import MIN_DEMONSTRATIONS
from app.pipeline.findings.rules import PASSES_CLOSE, SAMPLES_DISAGREE, STRAYING, UNSUPPORTED
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_LISTED = 4  # numbers of actions that a sentence lists
NEARER, NEARER_M = 0.5, 0.03  # than every demonstrated hand: times its distance, and by this at least


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
    found = []
    if unsupported:
        message = f"{unsupported[0].unsupported}."
        if len(unsupported) > 1:
            message = f"{_named(unsupported)} are unlike the demonstrations; the first: {message}"
        numbers: dict[str, float] = {"num_actions": len(unsupported)}
        found.append(UNSUPPORTED.finding(message, f"actions[{unsupported[0].index}]", numbers))
    if straying:
        off_deg, worst = max(doubt.off_deg for doubt in straying), max(straying, key=lambda doubt: doubt.off_m)
        message = (
            f"{_named(straying)} {'lies' if len(straying) == 1 else 'lie'} up to {100 * worst.off_m:.1f} cm and"
            f" {off_deg:.0f} degrees beyond where the demonstrations have them, seen from {worst.seen_from}."
        )
        numbers = {"num_actions": len(straying), "off_m": worst.off_m, "off_deg": off_deg}
        found.append(STRAYING.finding(message, f"actions[{straying[0].index}]", numbers))
    return tuple(found)


def _named(doubts: Sequence[ActionDoubt]) -> str:
    numbers = [str(doubt.index + 1) for doubt in doubts]
    if len(numbers) == 1:
        return f"Action {numbers[0]}"
    if len(numbers) > MAX_LISTED:
        return f"Actions {', '.join(numbers[:MAX_LISTED])} and {len(numbers) - MAX_LISTED} more"
    return f"Actions {', '.join(numbers[:-1])} and {numbers[-1]}"


def disagreeing_findings(num_samples: int, num_alike: int) -> tuple[Finding, ...]:
    """A doubt where no more than half of several replies do what the chosen one does."""
    if 2 * num_alike > num_samples:
        return ()
    message = f"Only {num_alike} of {num_samples} replies do what this one does; the others do otherwise."
    return (SAMPLES_DISAGREE.finding(message, "reply", {"num_alike": num_alike, "num_samples": num_samples}),)


@dataclass(frozen=True, eq=False)
class ShownWays:
    """How near the hands of demonstrations came to their objects; computed once."""

    demonstrations: tuple[Demonstration, ...]

    def least_m(self, name: str, mentioned: Sequence[str]) -> float | None:
        """The least distance from an object, or from what has its place in the instruction; None if nothing has.

        Args:
            mentioned: by the instruction, in its order.
        """
        key: str | int = mentioned.index(name) if name in mentioned else name
        return self._least_m.get(key)

    @cached_property
    def _least_m(self) -> dict[str | int, float]:
        """By name, and by place in the instruction."""
        found: dict[str | int, float] = {}
        for demonstration in self.demonstrations:
            least_m = _least_m(demonstration)
            named: list[tuple[str | int, str]] = [(name, name) for name in least_m]
            for key, name in [*named, *enumerate(demonstration.order.objects if least_m else ())]:
                found[key] = min(least_m[name], found.get(key, math.inf))
        return found


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


def passing_findings(
    query: Query, actions: Sequence[EndEffectorAction], shown: ShownWays, bystanders: Sequence[ObjectPose] = ()
) -> Iterator[Finding]:
    """What the hand passes by far nearer than any demonstrated hand did; one finding for each such object.

    Args:
        query: the objects as they were observed, and where the hand is before the first action, if that is known.
        bystanders: other objects, which demonstrations did not have.
    """
    if len(shown.demonstrations) < MIN_DEMONSTRATIONS or not actions:
        return
    way_m = way(query.start, actions)
    kept_m = [(pose, shown.least_m(pose.name, query.order.objects)) for pose in query.objects]
    for pose, least_m in (*kept_m, *((pose, math.inf) for pose in bystanders)):
        all_m = distances_m(way_m, pose.position_m)
        near_m = float(all_m.min())
        if least_m is None or near_m > min(PASSES_CLOSE.levels["warning"], NEARER * least_m, least_m - NEARER_M):
            continue
        number = max(0, int(all_m.argmin()) - (query.start is not None))
        is_new = math.isinf(least_m)
        kept = "demonstrations do not have it" if is_new else f"demonstrations kept {100 * least_m:.1f} cm away"
        message = (
            f"On the way to action {number + 1} the hand passes {100 * near_m:.1f} cm from the center of {pose.name!r};"
            f" {kept}. The hand, or what it holds, may hit it."
        )
        numbers = {"distance_m": near_m, "action": number, **({} if is_new else {"demonstrated_m": least_m})}
        yield PASSES_CLOSE.finding(message, f"objects[{pose.name}]", numbers, value=near_m)
