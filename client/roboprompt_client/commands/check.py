"""`roboprompt-robot check` and `doctor`: whether an arm does what the Robot Protocol says, and what is missing."""

import math
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from roboprompt_client.cell import open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.look import AddCommand
from roboprompt_client.commands.terminal import ask_yes, say
from roboprompt_client.errors import MotionError, RoboPromptError
from roboprompt_client.robot import Robot
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array, finite_array
from roboprompt_client.types.poses import EndEffectorAction, Pose
from roboprompt_client.version import VERSION

LIFT_M, TURN_RAD = 0.03, math.radians(10)
POSITION_TOLERANCE_M, ROTATION_TOLERANCE_DEG = 0.005, 2.0
TOUCH_TOLERANCE_M = 0.005  # a hand that is guided to a corner is there within 2 mm
MAX_OBSERVE_S = 1.0  # longer, and observing before each contact delays the motion noticeably
STOP_AFTER_S, MAX_STOP_S = 0.3, 1.0
MARKS = {True: "ok  ", False: "FAIL", None: "look"}
# The modules that each extra of roboprompt-client brings.
EXTRAS = {
    "images": ("cv2", "msgpack"),
    "franka": ("franky",),
    "ur": ("rtde_control",),
    "xarm": ("xarm",),
    "lerobot": ("lerobot",),
    "urdf": ("pinocchio",),
}


class CheckResult(NamedTuple):
    """One check.

    Attributes:
        passed: None where it could not be decided.
        detail: what was seen, with its numbers, and what to do about it.
    """

    name: str
    passed: bool | None
    detail: str


def add_check(add: AddCommand, robot_help: str) -> None:
    """Add `check` and `doctor` to the script's commands."""
    what = "see whether an arm does what the Robot Protocol says; without --move nothing moves"
    check = add("check", what, run_check)
    check.add_argument("--robot", metavar="ROBOT", required=True, help=robot_help)
    check.add_argument("--move", action="store_true", help="3 cm up, a turn by 10 degrees, gripper, stop; asks first")
    what = (
        "meters, world frame: a place, such as a corner of the ChArUco board, to which you guide the fingers by "
        "hand; says how far off the arm takes itself to be (may be repeated)"
    )
    place = ("X", "Y", "Z")
    check.add_argument("--touch", nargs=3, type=float, action="append", default=[], metavar=place, help=what)
    doctor = add("doctor", "say what is missing or wrong: service, packages, and the arm if named", run_doctor)
    doctor.add_argument("--robot", metavar="ROBOT", help=robot_help)


def run_check(_: RoboPromptClient, arguments: Namespace) -> int:
    """Print the report; 1 where something failed."""
    robot = open_robot(arguments.robot, cameras=False)
    for k, place_m in enumerate(arguments.touch):
        finite_array(f"--touch[{k}]", place_m, (3,))

    def confirm(question: str) -> bool:
        return ask_yes(f"{question} [y/N] ")

    return _report(ArmCheck(robot, moves=arguments.move, confirm=confirm, touched_m=arguments.touch).run())


def run_doctor(client: RoboPromptClient, arguments: Namespace) -> int:
    """Print what was found; 1 where the service or the named arm fails."""
    results = [*look_at_service(client), *map(look_at_extra, EXTRAS)]
    if arguments.robot is not None:
        try:
            results += ArmCheck(open_robot(arguments.robot)).run()
        except RoboPromptError as error:
            results.append(CheckResult("arm", False, str(error)))
    return _report(results)


def _report(results: Sequence[CheckResult]) -> int:
    """A line for each; 1 where something failed."""
    for result in results:
        say(f"{MARKS[result.passed]}  {result.name}: {result.detail}")
    return int(any(result.passed is False for result in results))


def look_at_service(client: RoboPromptClient) -> Iterator[CheckResult]:
    """Whether it answers, takes the key, and has this version."""
    try:
        client.ping()
    except RoboPromptError as error:
        yield CheckResult("service", False, f"{error}: roboprompt serve, or name another address by --url")
        return
    yield CheckResult("service", True, f"answers at {client.url}")
    try:
        version = client.get("/openapi.json")["info"]["version"]
    except RoboPromptError as error:
        yield CheckResult("key", None, f"may not read ({error}): ROBOPROMPT_API_KEY, roboprompt keys add --scope read")
        return
    same = True if version == VERSION else None
    remedy = "" if same else ": install the client of the service's version"
    yield CheckResult("version", same, f"service {version}, this client {VERSION}{remedy}")


def look_at_extra(extra: str) -> CheckResult:
    """Whether the modules of an extra are installed."""
    lacking = [module for module in EXTRAS[extra] if find_spec(module) is None]
    remedy = f"{', '.join(lacking)} not installed; if you need it: pip install 'roboprompt-client[{extra}]'"
    return CheckResult(f"extra {extra}", None if lacking else True, remedy if lacking else "installed")


class ArmCheck:
    """Checks one robot; with `moves` it lifts the hand by 3 cm, turns it by 10 degrees and works the gripper.

    Args:
        confirm: asked before the first motion, and when a place is touched; None: go.
        touched_m: places in the world frame, meters, to which a person guides the point between the fingertips, such as
            corners of the ChArUco board that the camera was calibrated with.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        moves: bool = False,
        confirm: Callable[[str], bool] | None = None,
        touched_m: Sequence[Sequence[float]] = (),
    ) -> None:
        self._robot, self._moves, self._touched_m = robot, moves, touched_m
        self._confirm = confirm or (lambda _: True)
        self._results: list[CheckResult] = []

    def run(self) -> tuple[CheckResult, ...]:
        """All checks; the arm is stopped where one goes wrong, and the moving ones end there."""
        if (start := self._check_observation()) is not None:
            for place_m in self._touched_m:
                self._check_touch(np.array(place_m))
            rises = f"The hand will rise by {100 * LIFT_M:.0f} cm and turn by 10 degrees. Is the space above it free?"
            if self._moves and self._confirm(rises):
                self._check_motions(start)
        return tuple(self._results)

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
            lacking = "is not given: tasks that bound steps need it, and so do the motions"
            self._say("observe: end_effector", None, lacking)
            return None
        norm = math.hypot(*hand.quaternion_xyzw)
        self._say("observe: quaternion", abs(norm - 1) < 1e-3, f"has the norm {norm:.4f}; order x y z w")
        down = rotations.rotated(hand.quaternion_xyzw, (0, 0, 1))[2]
        place = ", ".join(f"{value:.3f}" for value in hand.position_m)
        detail = f"hand at {place} m, its z axis {math.degrees(math.acos(np.clip(-down, -1, 1))):.0f} degrees from down"
        self._say("observe: end_effector", None, f"{detail}: measure it")
        return hand

    def _check_touch(self, place_m: Array) -> None:
        """Whether the arm's base and tool are where the calibration has them."""
        named = ", ".join(f"{value:.3f}" for value in place_m)
        if not self._confirm(f"Guide the point between the fingertips to {named} m, by hand. Is it there?"):
            self._say(f"touch {named}", None, "was left out")
            return
        try:
            hand = self._robot.observe().end_effector
        except RoboPromptError as error:
            self._say(f"touch {named}", False, str(error))
            return
        assert hand is not None
        off_m = np.array(hand.position_m) - place_m
        along = ", ".join(f"{1000 * value:+.1f}" for value in off_m)
        detail = f"the arm says {1000 * np.linalg.norm(off_m):.1f} mm off ({along} along x, y, z)"
        remedy = "base_to_world, the tool's length or the board's place are wrong by that"
        passed = float(np.linalg.norm(off_m)) <= TOUCH_TOLERANCE_M
        self._say(f"touch {named}", passed, detail if passed else f"{detail}: {remedy}")

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
        off_m = float(np.linalg.norm(np.array(hand.position_m) - action.position_m))
        off_deg = math.degrees(rotations.angle_between_rad(hand.quaternion_xyzw, action.quaternion_xyzw))
        detail = f"{1000 * off_m:.1f} mm and {off_deg:.1f} degrees off after {took_s:.1f} s"
        passed = off_m <= POSITION_TOLERANCE_M and off_deg <= ROTATION_TOLERANCE_DEG
        return self._say(name, passed, f"{detail}; did the arm do what it says?")

    def _check_stop(self, action: EndEffectorAction) -> None:
        ended: list[BaseException | None] = []

        def move() -> None:
            try:
                self._robot.execute(action)
                ended.append(None)
            except Exception as error:  # an adapter may raise anything: that is what is looked at
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
        if motion.is_alive() or not ended:
            self._say("stop", False, f"execute did not end within {MAX_STOP_S} s of stop()")
        elif isinstance(ended[0], MotionError):
            self._say("stop", True, f"ended the motion after {1000 * took_s:.0f} ms")
        else:
            what = "as if it had arrived" if ended[0] is None else f"with {type(ended[0]).__name__}"
            self._say("stop", False, f"execute ended {what}: it is to raise MotionError")

    def _say(self, name: str, passed: bool | None, detail: str) -> bool:
        self._results.append(CheckResult(name, passed, detail))
        return passed is not False
