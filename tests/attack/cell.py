"""A table with a few things and a hand without joints: do the actions of an answer do to them what was meant?"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

GRASP_M, GRASP_DEG = 0.025, 20.0  # how far the fingers may be off, and turned, and still hold a thing
TOUCH_M = 0.025
DROP_M = 0.03  # a thing that is let go of higher than that above where it belongs falls over
UP = np.array([0.0, 0.0, 1.0])


@dataclass
class Thing:
    """A thing on the table.

    Attributes:
        place: (3,) m, where hands take it.
        turn_deg: about the vertical.
        long: whether fingers must close across it.
    """

    place: np.ndarray
    turn_deg: float = 0.0
    long: bool = False
    hand: Rotation = field(default_factory=Rotation.identity)

    @property
    def turn(self):
        """As a rotation."""
        return Rotation.from_euler("z", self.turn_deg, degrees=True)


@dataclass
class Cell:
    """What the actions did.

    Attributes:
        held: the thing in the hand.
        touched: things that the closed, empty hand came to, in order.
        turned_deg: how far the closed hand turned about the vertical at its place, in all.
        let_go: places at which things were let go of.
    """

    things: dict[str, Thing]
    held: str | None = None
    touched: list[str] = field(default_factory=list)
    turned_deg: float = 0.0
    let_go: dict[str, np.ndarray] = field(default_factory=dict)
    lifted_m: float = 0.0
    fist_m: list[np.ndarray] = field(default_factory=list)  # where the closed hand stopped

    def carry_out(self, actions):
        """Each action after the other; the cell."""
        place, hand, was_open = None, None, actions[0]["gripper_open"]
        for action in actions:
            to, turned, is_open = (
                np.array(action["position"]),
                Rotation.from_quat(action["quaternion_xyzw"]),
                action["gripper_open"],
            )
            if place is not None:
                self._move(place, hand, to, turned, was_open)
            if not is_open:
                self.fist_m.append(to)
            self._switch(to, turned, was_open, is_open)
            place, hand, was_open = to, turned, is_open
        return self

    def _move(self, place, hand, to, turned, was_open):
        if not was_open and np.linalg.norm(to - place) < TOUCH_M:
            self.turned_deg += float((turned * hand.inv()).as_rotvec(degrees=True)[2])
        if self.held is None:
            return
        thing, way = self.things[self.held], turned * hand.inv()
        thing.place = to + way.apply(thing.place - place)
        thing.turn_deg += float(way.as_euler("zyx", degrees=True)[0])
        self.lifted_m = max(self.lifted_m, float(to[2] - place[2]))

    def _switch(self, to, hand, was_open, is_open):
        if is_open:
            if self.held is not None:
                self.let_go[self.held] = self.things[self.held].place.copy()
            self.held = None
            return
        near = min(self.things, key=lambda name: np.linalg.norm(self.things[name].place - to))
        distance_m = np.linalg.norm(self.things[near].place - to)
        if was_open and self.held is None and distance_m < GRASP_M and self._fits(self.things[near], hand):
            self.held, self.lifted_m = near, 0.0
        elif self.held is None and distance_m < TOUCH_M and self.touched[-1:] != [near]:
            self.touched.append(near)
        elif distance_m > 2 * TOUCH_M and self.touched and self.touched[-1] != "":
            self.touched.append("")

    def _fits(self, thing, hand):
        if not thing.long:
            return True
        along = float(hand.apply([0.0, 1.0, 0.0]) @ thing.turn.apply([1.0, 0.0, 0.0]))
        return abs(along) < np.sin(np.radians(GRASP_DEG))

    def took(self, name):
        """Whether the thing is in the hand, and lifted."""
        return self.held == name and self.lifted_m > 0.05

    def put(self, name, place, turn_deg=None, within_m=0.025, within_deg=12.0, every_deg=360.0):
        """Whether the thing was let go of at a place, turned so."""
        if name not in self.let_go or np.linalg.norm(self.let_go[name] - place) > within_m:
            return False
        if turn_deg is None:
            return True
        off = (self.things[name].turn_deg - turn_deg + every_deg / 2) % every_deg - every_deg / 2
        return abs(off) < within_deg

    def pressed(self, *names):
        """Whether the closed hand came to these things in this order, and to no other."""
        return [name for name in self.touched if name] == list(names)

    def visited(self, places):
        """Whether the closed hand stopped at these places, one after the other, and last at the last one low down."""
        k = 0
        for at in self.fist_m:
            if k < len(places) and np.linalg.norm(at - places[k]) < TOUCH_M:
                k += 1
            elif k == len(places) and at[2] < places[-1][2] + TOUCH_M and np.linalg.norm(at - places[-1]) > TOUCH_M:
                return False
        return k == len(places)
