"""Chooses the demonstrations that a prompt shows, by the plan that fits the scene, with findings that explain it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter

from app.pipeline.episode import Demonstration
from app.pipeline.groups import grouped, shown_together
from app.pipeline.plans.by_scene import Parting, parting
from roboprompt_client.types.poses import ObjectPose

MAX_WARMED = 4  # plans whose prompts a model reads ahead
FEW = 3  # least number of demonstrations that determine the anchor of a row
MAX_USUAL_ROWS = 20
COMMON_SHARE = 1 / 2
LISTED = 5  # demonstrations that a message names


@dataclass(frozen=True, eq=False)
class PlanChoice:
    """The demonstrations that a prompt shows."""

    shown: tuple[Demonstration, ...]


class PlanChooser:
    """Chooses among demonstrations with aligned rows.

    The scene chooses the plan if equal instructions name the same objects in the same order and a quantity of the scene
    separates their plans (`by_scene`); otherwise every prompt shows the most frequent plan and others that are not
    rare.
    """

    def __init__(self, demonstrations: Sequence[Demonstration]) -> None:
        self._all = tuple(demonstrations)
        self._usual = shown_together(self._all)

    def __call__(self, objects: Sequence[ObjectPose]) -> PlanChoice:
        """Return the choice for a scene; without objects that of the way with most demonstrations."""
        return self._of_ways([_chosen(parted, objects) if objects else _usual(parted)[0] for parted in self._parted])

    def likely(self) -> list[PlanChoice]:
        """Return the choices of the most frequent ways, most frequent first."""
        if not self._parted:
            return [self._of_ways([])]
        first, *others = self._parted
        return [self._of_ways([way, *(_usual(other)[0] for other in others)]) for way in _usual(first)[:MAX_WARMED]]

    def _of_ways(self, ways: Sequence[int]) -> PlanChoice:
        """Return the choice for one way of each separated group."""
        left_out = {d.id for d in self._never_shown}.union(*map(_not_of, ways, self._parted))
        shown = tuple(d for d in self._all if d.id not in left_out)
        return PlanChoice(shown)

    @cached_property
    def _parted(self) -> list[Parting]:
        """The separations of plans, one for each form of instruction that has one."""
        groups = grouped(self._all, attrgetter("order.form")).values()
        return [found for group in groups if (found := parting(group)) is not None]

    @cached_property
    def _never_shown(self) -> tuple[Demonstration, ...]:
        parted = {d.id for one in self._parted for d in one.demonstrations}
        usual = {d.id for d in self._usual}
        return tuple(d for d in self._all if d.id not in parted and d.id not in usual)


def _usual(parted: Parting) -> list[int]:
    """Return the ways, most frequent first."""
    return [way for way, _ in Counter(parted.ways.tolist()).most_common()]


def _not_of(way: int, parted: Parting) -> set[str]:
    """Return the ids of the demonstrations of other ways."""
    return {d.id for d, other in zip(parted.demonstrations, parted.ways, strict=True) if other != way}


def _chosen(parted: Parting, objects: Sequence[ObjectPose]) -> int:
    """Return the way of the most similar demonstrated scene."""
    apart = parted.quantity.apart(parted.values, parted.quantity.of(objects))
    return int(parted.ways[apart.argmin()])
