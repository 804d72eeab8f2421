"""Push the button of the named colour, and no other."""

from app.sim.tasks.buttons import COLOURS, ButtonTask


class PushButton(ButtonTask):
    """Success: the named button has been pressed once or more and no other has."""

    name = "push_button"

    @property
    def asked(self) -> tuple[str, ...]:
        return (COLOURS[self.variation],)

    def succeeded(self) -> bool:
        return set(self.events) == set(self.asked)
