"""A person at the terminal, who sees the plan and is asked before each motion."""

import sys
from collections.abc import Sequence

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.preview import Previewed, table
from roboprompt_client.motion_limits import MotionLimits
from roboprompt_client.robot import Robot
from roboprompt_client.trajectory import EndEffectorAction


class Person:
    """What the loop calls `preview` and `confirm`."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._shown: list[Previewed] = []  # in the order in which `confirm` is asked about them

    def preview(self, actions: Sequence[EndEffectorAction], limits: MotionLimits) -> None:
        """Print the plan, or that nothing is known of the arm."""
        if not isinstance(self._robot, Arm):
            _print("no preview: of this robot's arm nothing is known (a cell's file says it)")
            return
        previewed = self._robot.preview(actions, limits)
        self._shown += previewed
        if previewed:
            _print(table(previewed))

    def confirm(self, index: int, action: EndEffectorAction) -> bool:
        """Whether the person lets the action go, who hears first what is wrong with it."""
        if index < len(self._shown) and (warning := self._shown[index].warning):
            _print(f"! {warning}")
        gripper = "open" if action.gripper_open else "closed"
        x_m, y_m, z_m = action.position_m
        try:
            answer = input(f"action {index + 1}: to {x_m:.3f} {y_m:.3f} {z_m:.3f} m, gripper {gripper}. Go? [y/N] ")
        except EOFError:  # nobody is there to ask
            return False
        return answer.strip().lower() in ("y", "yes")


def _print(text: str) -> None:
    print(text, file=sys.stderr)  # noqa: T201
