"""`roboprompt-robot check`: whether an arm does what the Robot Protocol says."""

import math
import threading
import time
from argparse import Namespace

import numpy as np

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.shared import ROBOT, AddCommand, ask_yes, say
from roboprompt_client.errors import MotionError, RoboPromptError
from roboprompt_client.robot import Robot
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.poses import EndEffectorAction, Pose

LIFT_M, TURN_RAD = 0.03, math.radians(10)
POSITION_TOLERANCE_M, ROTATION_TOLERANCE_DEG = 0.005, 2.0
MAX_OBSERVE_S = 1.0  # a longer observation delays the motion noticeably where the robot looks again
STOP_AFTER_S, MAX_STOP_S = 0.3, 1.0
MOVE = "move 3 cm up, rotate by 10 degrees, close and open the gripper, stop; asks first"
MARKS = {True: "ok  ", False: "FAIL", None: "look"}


def add_check(add: AddCommand) -> None:
    """Add `check` to the commands."""
    what = "check whether an arm does what the Robot Protocol says; without --move nothing moves"
    check = add("check", what, run_check)
    check.add_argument("--robot", metavar="ROBOT", required=True, help=ROBOT)
    check.add_argument("--move", action="store_true", help=MOVE)


def run_check(_: RoboPromptClient, arguments: Namespace) -> int:
    """Print a line for each check as soon as it is done; return 1 if one failed, else 0."""
    with closing_robot(open_robot(arguments.robot, cameras=False)) as robot:
        return int(not ArmCheck(robot, moves=arguments.move).run())


class ArmCheck:
    """The checks of one robot; with `moves` it lifts the hand by 3 cm, rotates it by 10 degrees, and uses the gripper.

    Before the first motion it asks the person at the terminal.
    """

    def __init__(self, robot: Robot, *, moves: bool = False) -> None:
        self._robot, self._moves = robot, moves
        self._sound = True

    def run(self) -> bool:
        """Return whether no check failed; if a motion fails, the arm is stopped and further motions are left out."""
        start = self._check_observation()
        rises = f"The hand will rise by {100 * LIFT_M:.0f} cm and rotate by 10 degrees. Is the space above it free?"
        if start is not None and self._moves and ask_yes(f"{rises} [y/N] "):
            self._check_motions(start)
        return self._sound

    def _check_observation(self) -> Pose | None:
        began_s = time.monotonic()
        try:
            seen = self._robot.observe()
        except RoboPromptError as error:
            self._say("observe", False, str(error))
            return None
        took_s = time.monotonic() - began_s
        took = f"{1000 * took_s:.0f} ms (at most {1000 * MAX_OBSERVE_S:.0f} are good)"
        self._say("observe: time", took_s <= MAX_OBSERVE_S, took)
        names = ", ".join(pose.name for pose in seen.objects) or "no object"
        self._say("observe: objects", None if not seen.objects else True, f"{names}; {len(seen.frames)} cameras")
        if (hand := seen.end_effector) is None:
            lacking = "is missing: the motions need it, and so do tasks that bound steps"
            self._say("observe: end_effector", None, lacking)
            return None
        norm = math.hypot(*hand.quaternion_xyzw)
        self._say("observe: quaternion", abs(norm - 1) < 1e-3, f"has the norm {norm:.4f}; order x y z w")
        down_deg = 180 - math.degrees(rotations.tilt_rad(hand.quaternion_xyzw))
        place = ", ".join(f"{value:.3f}" for value in hand.position_m)
        detail = f"hand at {place} m, its z axis {down_deg:.0f} degrees from down: measure it"
        self._say("observe: end_effector", None, detail)
        if isinstance(self._robot, Arm) and (problem := self._robot.problem_with(hand)):
            self._say("observe: limits", None, f"the hand could not go to where it is: {problem}")
        return hand

    def _check_motions(self, start: Pose) -> None:
        home_m, home = np.array(start.position_m), np.array(start.quaternion_xyzw)
        lifted_m = home_m + np.array([0.0, 0.0, LIFT_M])
        turned = rotations.product(rotations.about_z(TURN_RAD), home)
        steps = (
            ("motion: up is +z", EndEffectorAction(lifted_m, home, True)),
            ("motion: a turn about +z", EndEffectorAction(lifted_m, turned, True)),
            ("gripper: closes", EndEffectorAction(lifted_m, home, False)),
            ("gripper: opens", EndEffectorAction(lifted_m, home, True)),
        )
        if all(self._moves_to(name, action) for name, action in steps):
            self._check_stop(EndEffectorAction(home_m, home, True))

    def _moves_to(self, name: str, action: EndEffectorAction) -> bool:
        began_s = time.monotonic()
        try:
            self._robot.execute(action)
            took_s = time.monotonic() - began_s
            hand = self._robot.observe().end_effector
        except RoboPromptError as error:
            self._robot.stop()
            return self._say(name, False, str(error))
        assert hand is not None
        off_m = math.dist(hand.position_m, action.position_m)
        off_deg = math.degrees(rotations.angle_between_rad(hand.quaternion_xyzw, action.quaternion_xyzw))
        detail = f"{1000 * off_m:.1f} mm and {off_deg:.1f} degrees off after {took_s:.1f} s; did the arm do it?"
        return self._say(name, off_m <= POSITION_TOLERANCE_M and off_deg <= ROTATION_TOLERANCE_DEG, detail)

    def _check_stop(self, action: EndEffectorAction) -> None:
        ended: list[Exception | None] = []

        def move() -> None:
            try:
                self._robot.execute(action)
                ended.append(None)
            except Exception as error:  # an adapter may raise anything; the kind is checked below
                ended.append(error)

        motion = threading.Thread(target=move, daemon=True)
        motion.start()
        motion.join(STOP_AFTER_S)
        if not motion.is_alive():
            self._say("stop", None, f"the motion took less than {STOP_AFTER_S} s: make the arm slower to see a stop")
            return
        began_s = time.monotonic()
        self._robot.stop()
        motion.join(MAX_STOP_S)
        took_s = time.monotonic() - began_s
        if not ended:
            self._say("stop", False, f"execute did not end within {MAX_STOP_S} s of stop()")
        elif isinstance(ended[0], MotionError):
            self._say("stop", True, f"ended the motion after {1000 * took_s:.0f} ms")
        else:
            what = "as if it had arrived" if ended[0] is None else f"with {type(ended[0]).__name__}"
            self._say("stop", False, f"execute ended {what}, but must raise MotionError")

    def _say(self, name: str, passed: bool | None, detail: str) -> bool:
        """Print a check's result; None: a person must compare it with a ruler, or it could not be decided."""
        say(f"{MARKS[passed]}  {name}: {detail}")
        self._sound &= passed is not False
        return passed is not False
