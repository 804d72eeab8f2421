"""Four colored buttons: `push_button`, `push_multiple_buttons` and `press_in_order`."""

from abc import abstractmethod
from itertools import chain, product
from typing import ClassVar

import numpy as np

from app.sim.moves import LOOSE_M, UP, Move, push, tool_down
from app.sim.scene import scatter
from app.sim.tasks.base import SimTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.types.arrays import Array

COLORS = ("red", "yellow", "green", "blue")
BASE_RADIUS_M, BASE_HEIGHT_M = 0.036, 0.034
CAP_RADIUS_M, CAP_HEIGHT_M = 0.026, 0.028  # of the part that stands out
TRAVEL_M = 0.022
PRESSED_M, RELEASED_M = 0.006, 0.003
# The fingers reach 8 mm beyond the tool's point, so 14 mm are pushed. Written as bins, a height changes by up to 5 mm:
# 9 to 19 mm of 22 remain.
PUSH_DEPTH_M = 0.006
CLEARANCES_M = (0.07, 0.12)  # by way
SPRING_N_M, PRELOAD_M = 150.0, 0.004
MAX_PRESSES = 6  # paper, appendix "Real robots experiments"
# Variation k asks for the k-th: first the single presses, then all pairs, ...
SEQUENCES = tuple(chain.from_iterable(product(COLORS, repeat=length) for length in range(1, MAX_PRESSES + 1)))
TEST_STREAM = 1  # keeps the draw of a test's sequence apart from that of the same seed's scene


class ButtonTask(SimTask):
    """Four buttons on the table, at least 13 cm apart, each anywhere in x 0.03..0.38 m, y -0.30..0.30 m.

    A button's pose is the center of its cap's top at rest. `events` are the colors pressed (by 6 mm), in order.
    """

    object_names = tuple(f"{color} button" for color in COLORS)
    variations = len(COLORS)
    ways = len(CLEARANCES_M)
    yaw_symmetry_deg = dict.fromkeys(object_names, 0.0)

    @property
    @abstractmethod
    def asked(self) -> tuple[str, ...]:
        """The colors to press, in order."""

    def succeeded(self) -> bool:
        return self.events == list(self.asked)

    def build(self, random: np.random.Generator) -> None:
        height_m = BASE_HEIGHT_M + CAP_HEIGHT_M
        points = scatter(random, len(COLORS), (0.03, -0.30), (0.38, 0.30), min_distance_m=0.13)
        for color, point in zip(COLORS, points, strict=True):
            button = self.add_part(f"{color} button", [*point, TABLE_TOP_M + height_m])
            base_center_m = [0, 0, BASE_HEIGHT_M / 2 - height_m]
            button.cylinder(BASE_RADIUS_M, BASE_HEIGHT_M / 2, "grey", at_m=base_center_m)
            cap = self.add_part(f"{color} cap", [0, 0, 0], parent=button)
            cap.cylinder(CAP_RADIUS_M, CAP_HEIGHT_M / 2, color, at_m=[0, 0, -CAP_HEIGHT_M / 2], mass_kg=0.02)
            cap.slide(color, (0, 0, -1), (0, TRAVEL_M), damping=2.0, spring_n_m=SPRING_N_M, spring_rest_m=-PRELOAD_M)

    def after_reset(self) -> None:
        self._joint_addresses = {color: self.model.joint(color).qposadr[0] for color in COLORS}
        self._down = dict.fromkeys(COLORS, False)

    def latch(self) -> None:
        for color, address in self._joint_addresses.items():
            depth_m = self.data.qpos[address]
            if depth_m > PRESSED_M and not self._down[color]:
                self._down[color] = True
                self.events.append(color)
            elif depth_m < RELEASED_M:
                self._down[color] = False

    @property
    def instruction(self) -> str:
        return ", then ".join(f"push the {color} button" for color in self.asked)

    def expert(self) -> list[Move]:
        moves: list[Move] = []
        for previous, color in zip((None, *self.asked), self.asked, strict=False):
            press = self._press(self.position_m(f"{color} button"))
            moves += press[1:] if color == previous else press  # the arm is above it already
        return moves

    def _press(self, top_m: Array) -> list[Move]:
        above, pushed = top_m + CLEARANCES_M[self.way] * UP, top_m - PUSH_DEPTH_M * UP
        return push([(above, LOOSE_M), (pushed, 0.0), (above, None)], tool_down())


class PushButton(ButtonTask):
    """Success: the named button has been pressed once or more and no other has."""

    name = "push_button"

    @property
    def asked(self) -> tuple[str, ...]:
        return (COLORS[self.variation],)

    def succeeded(self) -> bool:
        return set(self.events) == set(self.asked)


class PushMultipleButtons(ButtonTask):
    """The scene of `push_button`. Demonstrations press one button; tests ask for 1 to 6 presses, colors repeating.

    As in the paper, a test's number of presses is uniform in 1..6 and each color is drawn at random. Success: the
    buttons have been pressed in exactly the order asked for, with no other press.
    """

    name = "push_multiple_buttons"
    test_only_variations = len(SEQUENCES) - len(COLORS)

    @classmethod
    def test_variation(cls, seed: int) -> int:
        random = np.random.default_rng((TEST_STREAM, seed))
        colors = random.choice(COLORS, random.integers(1, MAX_PRESSES, endpoint=True))
        return SEQUENCES.index(tuple(colors.tolist()))

    @property
    def asked(self) -> tuple[str, ...]:
        return SEQUENCES[self.variation]


# "before" or "after", and the colors as the instruction names them
Order = tuple[str, tuple[str, ...]]


class PressInOrder(ButtonTask):
    """The scene of `push_button`; poses are the centers of the caps' tops.

    Demonstrated are two and three presses with "before", two with "after"; asked for are three with "after".
    Success: the buttons have been pressed in exactly the order asked for, with no other press.
    """

    name = "press_in_order"
    SHOWN: ClassVar[tuple[Order, ...]] = (
        ("before", ("red", "blue")),
        ("after", ("green", "red")),
        ("before", ("yellow", "green", "blue")),
        ("before", ("green", "yellow")),
        ("after", ("blue", "yellow")),
        ("before", ("blue", "red", "green")),
        ("before", ("yellow", "red")),
        ("after", ("red", "green")),
        ("before", ("green", "blue", "yellow")),
    )
    ASKED: ClassVar[tuple[Order, ...]] = (
        ("after", ("red", "blue", "green")),
        ("after", ("yellow", "red", "blue")),
        ("after", ("green", "yellow", "red")),
        ("after", ("blue", "green", "yellow")),
    )

    @property
    def asked(self) -> tuple[str, ...]:
        word, named = self.combination
        return tuple(named if word == "before" else named[::-1])

    @property
    def instruction(self) -> str:
        word, named = self.combination
        return "press " + f" {word} ".join(f"the {color} button" for color in named)
