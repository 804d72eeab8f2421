"""Push the button of the named colour: the paper's real-robot task of four colours."""

from app.sim.tasks.push_button import PushButton


class PushButtonReal(PushButton):
    """The scene, instructions and success of `push_button`, which has the real task's four colours already.

    The paper reports the simulated and the real button task apart; so does an evaluation by these two names.
    """

    name = "push_button_real"
