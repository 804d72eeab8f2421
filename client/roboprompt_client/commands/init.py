"""`roboprompt-robot init`: write a cell's file from a person's answers and the arm's measurements."""

import json
import math
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.panda import LIMITS_RAD
from roboprompt_client.arms.ur_geometry import MODELS
from roboprompt_client.cameras.realsense import realsense_serials
from roboprompt_client.cell import ARMS, open_robot, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.terminal import ask, ask_yes, guided_by_hand, say
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.extras import make_driver
from roboprompt_client.robot import observation_from_file
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.names import checked_name

ADDRESSED = ("franka", "ur", "xarm")  # others need a factory or options: LeRobot, ROS
MARGIN_M = 0.01  # around the touched corners, so that a hand on the table is within the workspace
MIN_SIDE_M = 0.05
REALTIME = Path("/sys/kernel/realtime")
WITHOUT_REALTIME = (
    "This computer has no real-time kernel: a Franka may stop with communication errors. Go on without one? [y/N] "
)
OPTIONS = 'Its options, a JSON object such as {"address": "192.168.0.2"} [Enter: none] '
WITHOUT_CAMERAS = "A file with the objects' poses, such as objects.json [Enter: none, or cameras later] "
CORNERS = (
    "Guide the fingertips to the lowest, nearest left corner of the space that the hand may use, then to the highest, "
    "farthest right one. Fingers on the table are the lowest. q leaves the space out."
)


def run_init(_: RoboPromptClient, arguments: Namespace) -> int:
    """Ask, measure, and write the file; only the gripper moves by itself.

    Raises:
        InvalidInputError: if the file exists, an option is invalid, or standard input ends.
        MotionError: if the arm cannot be reached; no file is left then.
    """
    path: Path = arguments.file
    if path.exists():
        raise InvalidInputError("FILE", f"{path} exists and is not overwritten", "a new name")
    if not path.parent.is_dir():
        raise InvalidInputError("FILE", f"there is no folder {path.parent}", "a file in a folder that exists")
    cell = _arm()
    _try_to_connect(cell)  # before a person answers what would be lost
    cell["base_to_world"] = _base()
    if cameras := [camera for serial in realsense_serials() if (camera := _camera(serial))]:
        cell["cameras"] = cameras
    elif objects := _answer(WITHOUT_CAMERAS, partial(_objects_file, path.parent)):
        cell["objects"] = objects
    write_cell(path, cell)
    try:
        robot = open_robot(str(path), cameras=False)
        measured = {}
        if isinstance(robot, Arm):
            with robot:
                measured = _measured(robot)
    except BaseException:
        path.unlink()
        raise
    write_cell(path, {**cell, **measured})
    then = f", then calibrate --robot {path}" if "cameras" in cell else ""
    say(f"\nwritten to {path}; next: roboprompt-robot check --robot {path} --move{then}")
    return 0


def _arm() -> dict[str, Any]:
    question = f"Which arm? [{', '.join(ADDRESSED)}, or MODULE:FACTORY of yours] "
    name = _answer(question, lambda text: text if ":" in text else _one_of((*ADDRESSED, "MODULE:FACTORY"), text))
    if name not in ADDRESSED:
        own = _answer(OPTIONS, _json_object)
        return {"arm": name, **({"options": own} if own else {})}
    options: dict[str, Any] = {"address": _answer("Its address, such as 172.16.0.2: ", str)}
    if name == "franka":
        options["model"] = _answer("Its model [panda or fr3]: ", partial(_one_of, LIMITS_RAD))
        if not _realtime_kernel() and ask_yes(WITHOUT_REALTIME):
            options["realtime"] = False
    if name == "ur":
        question = f"Its model [{', '.join(MODELS)}; Enter: another]: "
        model = _answer(question, lambda text: text and _one_of(MODELS, text))
        options.update({"model": model} if model else {})
    return {"arm": name, "options": options}


def _try_to_connect(cell: Mapping[str, Any]) -> None:
    """Raise as `open_robot` if the arm's package is missing, or the arm does not answer."""
    made = make_driver("arm", cell["arm"], ARMS, cell.get("options", {}))
    if hasattr(made, "close"):
        made.close()


def _realtime_kernel() -> bool:
    """Return whether Linux has a real-time kernel (PREEMPT_RT)."""
    try:
        return REALTIME.read_text().strip() == "1"
    except OSError:
        return False


def _base() -> dict[str, Any]:
    say("Where is the arm's base in the world frame, in which objects have their poses? Enter: at its origin.")
    position_m = _answer("x y z, meters: ", lambda text: _numbers(text or "0 0 0", 3))
    (yaw_deg,) = _answer("Rotated about z by, degrees: ", lambda text: _numbers(text or "0", 1))
    return {"position": position_m, "quaternion_xyzw": rotations.about_z(math.radians(yaw_deg)).tolist()}


def _objects_file(folder: Path, text: str) -> str:
    """Return the name of a file with object poses in the cell's folder; empty for none."""
    if text:
        try:
            observation_from_file("objects", folder / text)
        except InvalidInputError as error:
            raise ValueError(str(error)) from error
    return text


def _camera(serial: str) -> dict[str, Any]:
    """Return the entry of a plugged-in camera, without its pose; empty if the person leaves it out."""
    question = f"A RealSense, {serial}. Its name, such as front [Enter: leave it out] "
    if not (name := _answer(question, lambda text: checked_name("name", text) if text else "")):
        return {}
    mount = "camera_to_hand" if ask_yes("Does the hand carry it? [y/N] ") else "camera_to_world"
    return {"name": name, "driver": "realsense", "options": {"serial": serial}, mount: None}


def _measured(arm: Arm) -> dict[str, Any]:
    """Return what the arm measures: the hand's workspace, and the width of the open fingers."""
    state = arm.state()
    place = state.position_m.round(3).tolist()
    say(f"\nThe arm answers: its hand is at {place} m in the world frame. Compare with a ruler.")
    found: dict[str, Any] = {}
    if ask_yes("Measure the space that the hand may use, by hand? [y/N] ") and (box := _box(arm)) is not None:
        found["limits"] = {"workspace": box}
    width_m = state.gripper_width_m
    if width_m is not None and ask_yes("May the gripper close and open now? Nothing else moves. [y/N] "):
        arm.set_gripper(is_open=False)
        arm.set_gripper(is_open=True)
        found["open_width_m"] = round(float(arm.state().gripper_width_m or width_m), 4)
    return found


def _box(arm: Arm) -> dict[str, Any] | None:
    """Return the box between two opposite corners to which a person guides the hand; None if they leave it out."""
    say(CORNERS)
    with guided_by_hand(arm):
        while True:
            places_m = []
            for which in ("lowest", "highest"):
                if (place_m := _corner(arm, which)) is None:
                    return None
                places_m.append(place_m)
            corners_m = np.array(places_m)
            low_m, high_m = corners_m.min(axis=0), corners_m.max(axis=0)
            if (high_m - low_m).min() >= MIN_SIDE_M:
                return {"min": (low_m - MARGIN_M).round(3).tolist(), "max": (high_m + MARGIN_M).round(3).tolist()}
            sides_m = (high_m - low_m).round(3).tolist()
            say(f"These corners span {sides_m} m: every side must be at least {MIN_SIDE_M} m. Try again.")


def _corner(arm: Arm, which: str) -> Array | None:
    if (typed := ask(f"At the {which} corner? Enter: ")) is None:
        raise MotionError("standard input ended before both corners were touched")
    if typed == "q":
        return None
    place_m = arm.state().position_m
    say(f"  {place_m.round(3).tolist()} m")
    return place_m


def _answer(question: str, read: Callable[[str], Any]) -> Any:  # noqa: ANN401
    """Ask until an answer is valid; print what is wrong with the others."""
    while (text := ask(question)) is not None:
        try:
            return read(text)
        except ValueError as error:
            say(f"  {error}")
    raise InvalidInputError("standard input", "ended before all questions were answered", "a person who answers")


def _one_of(valid: Iterable[str], text: str) -> str:
    if text in valid:
        return text
    raise ValueError(f"{text!r:.40} is none of {', '.join(valid)}")


def _json_object(text: str) -> dict[str, Any]:
    found = json.loads(text or "{}")
    if not isinstance(found, dict):
        raise ValueError(f"{text!r:.40} is no JSON object")
    return found


def _numbers(text: str, count: int) -> list[float]:
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"{text!r:.40} is not {count} numbers")
    return numbers
