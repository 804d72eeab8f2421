"""Teach a task and run it in a new scene: `python -m roboprompt_client.example`, against a running service.

The arm is imaginary: it is at once where it is sent, and prints each action. The rest is as with a real arm.
"""

import argparse
from itertools import pairwise

import numpy as np

from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

TASK, INSTRUCTION = "example_press", "press the red button"
TAUGHT_M = ((0.40, 0.10, 0.02), (0.45, -0.15, 0.02), (0.55, 0.05, 0.02), (0.38, -0.05, 0.02), (0.50, 0.20, 0.02))
UNSEEN_M = (0.47, 0.12, 0.02)
HOME_M = np.array([0.30, 0.0, 0.50])
DOWN_XYZW = np.array([1.0, 0.0, 0.0, 0.0])
ABOVE_M, AT_M, PRESSED_M = (0.0, 0.0, 0.12), (0.0, 0.0, 0.01), 0.02  # relative to the button
FRAMES, PERIOD_S = 25, 0.05  # of each segment of a recording


class ImaginaryArm:
    """A `Robot`; a real one asks its cameras in `observe`, and moves in `execute`.

    Attributes:
        pressed: whether the hand has been within 2 cm of the button.
    """

    def __init__(self, button_m: tuple[float, float, float]) -> None:
        self._button_m, self._hand_m = button_m, HOME_M
        self.pressed = False

    def observe(self) -> Observation:
        """Return the button's pose and the hand's."""
        return Observation(button(self._button_m), end_effector=Pose(self._hand_m, DOWN_XYZW))

    def execute(self, action: EndEffectorAction) -> None:
        """Take the action's pose."""
        self._hand_m = action.position_m
        self.pressed |= bool(np.linalg.norm(self._hand_m - self._button_m) < PRESSED_M)
        print(f"the hand goes to {action.position_m.round(3)} m, gripper {'open' if action.gripper_open else 'closed'}")

    def stop(self) -> None:
        """Do nothing: this arm never moves on the way."""


def button(position_m: tuple[float, float, float]) -> ObjectPose:
    """Return the button's pose as the robot observes it."""
    return ObjectPose("red button", np.array(position_m), np.array([0.0, 0.0, 0.0, 1.0]))


def press(button_m: tuple[float, float, float]) -> Trajectory:
    """Return a demonstration as a person would guide it: above the button, down, and up again, with a rest at each."""
    above_m, at_m = np.add(button_m, ABOVE_M), np.add(button_m, AT_M)
    places = [HOME_M, above_m, above_m, at_m, at_m, above_m, above_m]
    positions_m = np.concatenate([np.linspace(a, b, FRAMES) for a, b in pairwise(places)])
    frames = len(positions_m)
    times_s = np.arange(frames) * PERIOD_S
    return Trajectory.from_poses(positions_m, np.tile(DOWN_XYZW, (frames, 1)), np.zeros(frames), times_s)


def teach_and_press(url: str) -> bool:
    """Teach five demonstrations, and press the button at a place that none of them shows; return whether it worked.

    Raises:
        RoboPromptError: if the service refuses or does not answer, or the robot refuses the answer.
    """
    with RoboPromptClient(url) as client:
        for place_m in TAUGHT_M:
            stored = client.upload(TASK, INSTRUCTION, press(place_m), Observation(button(place_m)))
            print(f"taught at {place_m} m: {len(stored['keyframes'])} keyframes")
        print(f"\nthe button now stands at {UNSEEN_M} m")
        arm = ImaginaryArm(UNSEEN_M)
        predicted = run_task(client, arm, TASK, INSTRUCTION)
        client.record_outcome(predicted.id, success=arm.pressed)
        print(f"\nthe LLM wrote {predicted.response['reply_text']!r}")
        print(f"{'pressed' if arm.pressed else 'not pressed'}; more at {client.url}/ui/predictions/{predicted.id}")
    return arm.pressed


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default=DEFAULT_URL, help="of the service (default: %(default)s)")
    try:
        parser.exit(int(not teach_and_press(parser.parse_args().url)))
    except RoboPromptError as error:
        parser.exit(1, f"{error}\n")
