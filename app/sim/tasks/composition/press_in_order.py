"""Press buttons in an order that "before" and "after" give."""

from app.sim.tasks.buttons import ButtonTask
from app.sim.tasks.composition.base import CompositionTask

# "before" or "after", and the colours as the instruction names them
Order = tuple[str, tuple[str, ...]]
SHOWN: tuple[Order, ...] = (
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
ASKED: tuple[Order, ...] = (
    ("after", ("red", "blue", "green")),
    ("after", ("yellow", "red", "blue")),
    ("after", ("green", "yellow", "red")),
    ("after", ("blue", "green", "yellow")),
)


class PressInOrder(CompositionTask, ButtonTask):
    """The scene of `push_button`; poses are the centres of the caps' tops.

    Demonstrated are two and three presses with "before", two with "after"; asked for are three with "after".
    Success: the buttons have been pressed in exactly the order asked for, with no other press.
    """

    name = "press_in_order"
    variations, test_only_variations = len(SHOWN), len(ASKED)

    @property
    def asked(self) -> tuple[str, ...]:
        word, named = (*SHOWN, *ASKED)[self.variation]
        return named if word == "before" else named[::-1]

    @property
    def instruction(self) -> str:
        word, named = (*SHOWN, *ASKED)[self.variation]
        return "press " + f" {word} ".join(f"the {colour} button" for colour in named)

    def succeeded(self) -> bool:
        return self.events == list(self.asked)
