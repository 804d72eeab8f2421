"""Chooses anchors with several origins: along single axes, between two objects, or of the hand's rotation alone.

The hand may be at a height of the world above an object, have x of one object and y of another, or move along a rail.
What it lets go of at one object may stay turned as it was taken, and be held beside its middle, as by a handle. Where
the gripper switches half-way between two objects, the place follows both.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchor_scatter import (
    CONTRADICTED_M,
    MIN_SCATTERED,
    SERVES_M,
    around,
    axes_scatter_m,
    certain_share,
    hands_at,
    offsets_scatter_m,
    poses_scatter_m,
)
from app.pipeline.representation.anchors import (
    START,
    WORLD,
    AnchorFrame,
    Anchors,
    anchor_poses,
    names_of,
    relative_row,
)
from app.pipeline.thresholds import TURNED_M
from roboprompt_client.types.arrays import Array

EQUAL_M = 0.002  # scatters that differ by less are equal
WORLD_REACH_M = 4.9  # the largest coordinate that a row of a prompt can hold
MIN_BETWEEN = 4  # demonstrations of a place between two objects, as the tenth is fitted too
TENTHS = range(1, 10)


def along_axes(group: Sequence[Demonstration], chosen: Sequence[Anchors], objects: Sequence[Anchors]) -> list[Anchors]:
    """Return the anchors, with several origins where demonstrations contradict that the hand follows the row's own.

    At least three demonstrations must scatter by `CONTRADICTED_M` or more seen from the row's own origin, and seen from
    another by a share that is small beyond chance. All axes must then scatter within `SERVES_M`. A hand that closes
    does so at the height of what it takes; heights that vary were misread. Rows around one in which a hand lets go
    between two objects, or of what it holds beside its middle, follow the same place.

    Args:
        objects: that rows may follow, each in the frame `wo`.
    """
    if len(group) < MIN_SCATTERED or not group[0].actions:
        return list(chosen)
    rows = _Rows(group, objects)
    found = [rows.turned_with(k, rows.followed(k, anchors)) for k, anchors in enumerate(chosen)]
    for k in group[0].switches:
        if found[k][0].frame == "o" and len(found[k][0].along) == len("xyz"):
            for row in rows.around(k):
                found[row] = found[k]
    if len(group) >= MIN_BETWEEN and len(objects) > 1:
        rows.put_between(found)
    return found


class _Rows:
    """The rows of demonstrations of one plan, with everything that they may follow: their M origins.

    Attributes:
        hands_m: (N, K, 3) the hand's positions in the world frame.
        origins: the world and each object, in the frame `wo`.
        origins_m: (M, N, 3) their positions.
        scatters_m: (M, K, 3) of the hand's positions along the world's axes, seen from each origin.
        turns_m: (M, K) of the hand's rotations.
        share: of a scatter that is small beyond chance along one axis.
    """

    def __init__(self, group: Sequence[Demonstration], objects: Sequence[Anchors]) -> None:
        self.group, self.hands_m = group, hands_at(group)
        self.origins = [(WORLD,) * len(group), *objects]
        self.origins_m = np.array([anchor_poses(origin, group).origin_m for origin in self.origins])
        self.scatters_m = np.array([offsets_scatter_m(self.hands_m - origin_m[:, None]) for origin_m in self.origins_m])
        if np.abs(self.hands_m).max() >= WORLD_REACH_M:
            self.scatters_m[0] = np.inf
        self.turns_m = np.array([_turns_m(group, origin) for origin in self.origins])
        self.share = certain_share(len(group), 1)
        self._axes_m: dict[Anchors, Array] = {}  # the scatter (K, 3) relative to anchors, as far as it is known

    def around(self, k: int) -> list[int]:
        """Return the rows in which the hand comes to the place of row `k`, or goes from it, in all demonstrations."""
        return np.flatnonzero(around(self.hands_m, k)).tolist()

    def _origin(self, anchors: Anchors) -> int:
        return [names_of(origin) for origin in self.origins].index(names_of(anchors))

    def followed(self, k: int, anchors: Anchors) -> Anchors:
        """Return the anchors of row `k`, with other origins along the axes that contradict the row's own."""
        own_m = self._scatter_m(k, anchors)
        if anchors[0] == START or (own_m < CONTRADICTED_M).all():
            return anchors
        own = self._origin(anchors)
        places = self._origins_of_axes(k, own_m, own)
        if (k == 0 or k in self.group[0].switches) and not self.group[0].actions[k].gripper_open:
            places[2] = own
        return _along(anchors, [self.origins[place] for place in places])

    def _origins_of_axes(self, k: int, own_m: Array, own: int) -> list[int]:
        """Return the origin of each axis of row `k`: as few different ones as explain the row.

        Args:
            own_m: (3,) the scatter as the row has it.
            own: the row's origin.
        """
        scatters_m = self.scatters_m[:, k]
        best, left_m = [own] * 3, own_m.copy()
        for axis, seen_m in enumerate(scatters_m.T):
            if own_m[axis] >= CONTRADICTED_M and seen_m.min() < self.share * own_m[axis]:
                best[axis] = int(np.flatnonzero(seen_m <= seen_m.min() + EQUAL_M)[0])
                left_m[axis] = seen_m.min()
        if left_m.max() >= SERVES_M:  # still not explained, as on the way from the start to an object
            return [own] * 3
        others = [place for place in best if place != own]
        for axis in range(3) if len(set(others)) > 1 else ():
            equal = [place for place in others if scatters_m[place, axis] <= own_m[axis] + EQUAL_M]
            if best[axis] == own and equal:
                best[axis] = equal[0]
        return best

    def turned_with(self, k: int, anchors: Anchors) -> Anchors:
        """Return the anchors of row `k`, with the hand's rotation relative to another object that it turns with.

        What the hand lets go of at one object may so keep the rotation of the other one, at which it was taken.
        Demonstrations must contradict the row's own rotation.
        """
        if anchors[0].place_turns or anchors[0].tenths < 10 or anchors[0] == START or len(self.origins) == 1:
            return anchors
        turns_m = self.turns_m[:, k]
        own_m = turns_m[self._origin(anchors) if anchors[0].hand_turns else 0]
        best = 1 + int(turns_m[1:].argmin())
        if own_m < CONTRADICTED_M or turns_m[best] >= min(self.share * own_m, SERVES_M):
            return anchors
        taken = self.origins[best]
        if names_of(taken) != names_of(anchors):
            anchors = tuple(
                held._replace(along=tuple((axis, dict(at.along).get(axis, at.object_name)) for axis in range(3)))
                for held, at in zip(taken, anchors, strict=True)
            )
        return self._beside_middle(k, anchors, taken) if turns_m[best] < TURNED_M else anchors

    def _beside_middle(self, k: int, anchors: Anchors, taken: Anchors) -> Anchors:
        """Return the anchors of a hand that holds an object beside its middle, as by a handle.

        Its place then turns with the object at which it was taken, about a third one. Demonstrations must contradict
        the row's own place.
        """
        off_m = self._scatter_m(k, anchors).max()
        about = [_at(taken, "o", [origin] * 3) for origin in self.origins[1:] if origin != taken]
        aside = min(about, key=lambda each: self._scatter_m(k, each).max(), default=anchors)
        explains = off_m >= CONTRADICTED_M and self._scatter_m(k, aside).max() < min(self.share * off_m, TURNED_M)
        return aside if explains else anchors

    def _scatter_m(self, k: int, anchors: Anchors) -> Array:
        """Return the scatter (3,) of the hand's place in row `k` along the anchors' axes."""
        if anchors not in self._axes_m:
            self._axes_m[anchors] = axes_scatter_m(self.group, anchors)
        scatter_m: Array = self._axes_m[anchors][k]
        return scatter_m

    def put_between(self, found: list[Anchors]) -> None:
        """Anchor rows between two objects where the gripper switches there and follows no single origin.

        Demonstrations must scatter by `CONTRADICTED_M` or more in the plane from every single origin, and from a place
        between two objects by less and by a share of it that is small beyond chance. The rows around follow it, too.
        """
        share = certain_share(len(self.group) - 1, 1)
        pairs = [(*pair, tenth) for pair in combinations(range(1, len(self.origins)), 2) for tenth in TENTHS]
        for k in self.group[0].switches:
            own_m, _ = relative_row(self.group, k, found[k])
            single_m = offsets_scatter_m(np.moveaxis(self.hands_m[:, k] - self.origins_m, 1, 0)).min(axis=0)[:2]
            least_m = min(_plane_m(own_m), float(np.linalg.norm(single_m)))
            if least_m < CONTRADICTED_M:
                continue
            best = min(pairs, key=lambda pair: _plane_m(self._from_between_m(k, *pair)))
            if _plane_m(self._from_between_m(k, *best)) <= min(CONTRADICTED_M, share * least_m):
                for row in self.around(k):
                    found[row] = self._between(row, found[row], *best)

    def _from_between_m(self, k: int, one: int, other: int, tenths: int) -> Array:
        """Return (N, 3) where hands are, seen from so many tenths of the way from one origin to another."""
        one_m, other_m = self.origins_m[one], self.origins_m[other]
        seen_m: Array = self.hands_m[:, k] - one_m - tenths / 10 * (other_m - one_m)
        return seen_m

    def _between(self, k: int, own: Anchors, one: int, other: int, tenths: int) -> Anchors:
        """Return the anchors between two objects; the hand's rotation follows one of them, or the world.

        The height is that of the place between, or of the world where it scatters half as much.
        """
        names = names_of(own)
        if own[0].hand_turns and names == names_of(self.origins[other]):
            one, other, tenths = other, one, 10 - tenths
        frame: AnchorFrame = "wo" if own[0].hand_turns and names == names_of(self.origins[one]) else "w"
        if own[0].hand_turns and frame == "w":
            return own
        between_m = offsets_scatter_m(self._from_between_m(k, one, other, tenths))[2]
        height = 0 if offsets_scatter_m(self.hands_m[:, k])[2] < between_m / 2 else other
        along = [self.origins[place] for place in (other, other, height)]
        return tuple(anchor._replace(tenths=tenths) for anchor in _at(self.origins[one], frame, along))


def _turns_m(group: Sequence[Demonstration], origin: Anchors) -> Array:
    """Return the scatter (K,) of the hand's rotations seen from an origin, by `M_PER_RAD`."""
    objects = [d.object(at.object_name) for d, at in zip(group, origin, strict=True) if at.object_name]
    if any(pose.quaternion_xyzw is None for pose in objects):
        return np.full(len(group[0].actions), np.inf)
    turns_m: Array = poses_scatter_m(group, origin)[1]
    return turns_m


def _along(anchors: Anchors, followed: Sequence[Anchors]) -> Anchors:
    own, aside = anchors, any(names_of(origin) != names_of(anchors) for origin in followed[:2])
    frame: AnchorFrame = "wo" if anchors[0].frame == "o" and aside else anchors[0].frame
    tilts = anchors[0].place_turns and any(anchor.at_tilted for anchor in anchors)
    if not aside and (tilts or names_of(followed[2]) == names_of(anchors)):
        return anchors
    if not anchors[0].hand_turns:  # the row then needs no rotation of the object that it names first
        objects = [origin for origin in followed if any(names_of(origin))]
        if not objects:
            return followed[0]  # the world
        own, frame = max(objects, key=objects.count), "w"
    return _at(own, frame, followed)


def _at(own: Anchors, frame: AnchorFrame, followed: Sequence[Anchors]) -> Anchors:
    others = [(axis, names_of(origin)) for axis, origin in enumerate(followed) if names_of(origin) != names_of(own)]
    return tuple(
        anchor._replace(frame=frame, along=tuple((axis, names[k]) for axis, names in others))
        for k, anchor in enumerate(own)
    )


def _plane_m(seen_m: Array) -> float:
    return float(np.linalg.norm(offsets_scatter_m(seen_m)[:2]))
