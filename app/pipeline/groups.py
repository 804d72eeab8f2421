"""Groups of demonstrations: by a key or by plan, which plans are usual, and what decides between several."""

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import groupby
from operator import attrgetter
from typing import TypeVar

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.thresholds import RARE_SHARE

Key = TypeVar("Key", bound=Hashable)
Item = TypeVar("Item")
Made = TypeVar("Made")
Group = tuple[Demonstration, ...]
MIN_PER_INSTRUCTION = 2  # demonstrations, on average, to see that their plan is no chance
SCENE_DECIDES_SHARE = 0.8  # of the demonstrations have the plan of the nearest other scene


def grouped(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Return the items of each key."""
    groups: dict[Key, list[Item]] = defaultdict(list)
    for item in items:
        groups[key(item)].append(item)
    return groups


def places_by(items: Sequence[Item], key: Callable[[Item], Key]) -> dict[Key, list[int]]:
    """Return the indices of the items of each key."""
    return grouped(range(len(items)), lambda place: key(items[place]))


def made_by_group(
    items: Sequence[Item], key: Callable[[Item], Hashable], make: Callable[[list[Item]], Iterable[Made]]
) -> tuple[Made, ...]:
    """Return what `make` makes of each item among those of its key, in the order of the items."""
    made: dict[int, Made] = {}
    for places in places_by(items, key).values():
        made.update(zip(places, make([items[place] for place in places]), strict=True))
    return tuple(made[place] for place in range(len(items)))


def by_plan(demonstrations: Sequence[Demonstration]) -> list[Group]:
    """The demonstrations of each form of instruction and plan."""
    return [tuple(group) for group in grouped(demonstrations, attrgetter("kind")).values()]


def shown_together(demonstrations: Sequence[Demonstration]) -> Group:
    """The demonstrations that a prompt shows: of each instruction the usual plan, and others that are not rare.

    A rare plan (a second try after a slip) would only be copied by mistake, unless the scene calls for it (then scenes
    near to each other have the same plan) or the instruction (then all that name the same objects have).
    """
    kept: set[int] = set()
    for places in places_by(demonstrations, attrgetter("order.form")).values():
        group = [demonstrations[k] for k in places]
        counts = Counter(shown.kind for shown in group)
        usual, decides = counts.most_common(1)[0][0], is_decided(group)
        often = {kind for kind, count in counts.items() if kind == usual or count > RARE_SHARE * len(group)}
        kept |= {k for k in places if decides or demonstrations[k].kind in often}
    return tuple(demonstrations[k] for k in sorted(kept))


def is_decided(group: Sequence[Demonstration]) -> bool:
    """Whether scene or words decide between several plans of demonstrations of one form of instruction."""
    several = len({demonstration.kind for demonstration in group}) > 1
    return several and (_scene_decides(group) or words_decide(group))


def usual_ways(group: Sequence[Demonstration]) -> list[Group]:
    """The demonstrations of each plan that is not rare, of those of one form of instruction.

    Keyframes that were not aligned have no plan; there the gripper's switches tell.
    """
    return [tuple(way) for way in grouped(group, _way).values() if len(way) > RARE_SHARE * len(group)]


def _way(demonstration: Demonstration) -> tuple[int | bool, ...]:
    if demonstration.plan is not None:
        return demonstration.plan, len(demonstration.actions)
    return tuple(state for state, _ in groupby(action.gripper_open for action in demonstration.actions))


def _scene_decides(group: Sequence[Demonstration]) -> bool:
    """Whether the nearest other scene of most demonstrations has the same plan."""
    scenes_m = np.array([[pose.position_m for pose in demonstration.objects] for demonstration in group])
    between_m = np.linalg.norm(scenes_m[:, None] - scenes_m[None], axis=3).sum(axis=2)
    np.fill_diagonal(between_m, np.inf)
    keys = [demonstration.kind for demonstration in group]
    same = [keys[k] == keys[int(nearest)] for k, nearest in enumerate(between_m.argmin(axis=1))]
    rare = Counter(keys).most_common()[-1][0]
    rarely = [hit for key, hit in zip(keys, same, strict=True) if key == rare]
    return bool(np.mean(same) >= SCENE_DECIDES_SHARE and np.mean(rarely) >= SCENE_DECIDES_SHARE)


def words_decide(group: Sequence[Demonstration]) -> bool:
    """Whether demonstrations of the same words have the same plan, and several do."""
    by_words = grouped(group, attrgetter("instruction")).values()
    one_plan = all(len({shown.kind for shown in alike}) == 1 for alike in by_words)
    return one_plan and len(group) >= MIN_PER_INSTRUCTION * len(by_words)
