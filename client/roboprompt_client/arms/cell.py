"""A cell's file: which arm, where it stands, what bounds it, what there is to see.

    {"arm": "franka", "options": {"address": "172.16.0.2"},
     "base_to_world": {"position": [0, 0, 0.6], "quaternion_xyzw": [0, 0, 0, 1]},
     "limits": {"workspace": {"min": [0.2, -0.4, 0.6], "max": [0.7, 0.4, 1.2]}},
     "objects": "objects.json", "tolerance": {"position_m": 0.005, "max_contact_force_n": 30}, "open_width_m": 0.08,
     "reach_m": 0.85, "urdf": {"file": "arm.urdf", "frame": "tool0"},
     "cameras": [{"name": "front", "driver": "realsense", "camera_to_world": [[...], ...]}],
     "lost_contact": "stop", "viewpoints": [{"position": [0.4, 0, 1.1], "quaternion_xyzw": [1, 0, 0, 0]}]}

Only `arm` is needed; it may also be MODULE:FACTORY, a callable that returns a Robot or a driver for `Arm`.
Cameras: `roboprompt_client.cameras.cell`. Without the service a run goes on unless `lost_contact` is "stop".
"""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.arrival import Tolerance
from roboprompt_client.arms.calibration import Calibration
from roboprompt_client.arms.urdf import UrdfGeometry
from roboprompt_client.cameras.cell import rig_from_json, viewpoints_from_json
from roboprompt_client.cameras.rig import Rig
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import make_driver
from roboprompt_client.live import checked_on_lost
from roboprompt_client.motion_limits import MotionLimits, checked_bound
from roboprompt_client.robot import Observation, Robot, observation_from_file

DRIVERS = {
    "franka": "roboprompt_client.arms.franka:Franka",
    "ur": "roboprompt_client.arms.ur:UR",
    "xarm": "roboprompt_client.arms.xarm:XArm",
    "lerobot": "roboprompt_client.arms.lerobot:LeRobotArm",
    "ros": "roboprompt_client.arms.ros:Ros",
}
CELL_FIELDS = (
    "arm",
    "options",
    "base_to_world",
    "limits",
    "objects",
    "tolerance",
    "open_width_m",
    "reach_m",
    "urdf",
    "cameras",
    "viewpoints",
    "table",
    "lost_contact",
)


def open_robot(name: str, *, cameras: bool = True) -> Robot:
    """A robot by MODULE:FACTORY, or by a cell's file.

    Args:
        cameras: whether a cell's are opened, too; without them its arm does not go to viewpoints, either.

    Raises:
        InvalidInputError: if there is no such factory, or the file says something that cannot be.
        MotionError: if the arm cannot be reached.
    """
    if ":" not in name or Path(name).exists():
        return open_cell(Path(name), cameras=cameras)
    robot: Robot = make_driver("arm", name, DRIVERS, {})
    return robot


@contextmanager
def closing_robot(robot: Robot) -> Iterator[Robot]:
    """The robot, which is stopped and left in the end, its cameras too, where it is a cell's."""
    try:
        yield robot
    finally:
        if isinstance(robot, Arm):
            robot.close()


def open_cell(path: Path, *, cameras: bool = True) -> Robot:
    """The robot of a cell's file; arguments and errors as of `open_robot`."""
    cell = read_cell(path)
    with ExitStack() as opened:
        rig = rig_from_json(cell["cameras"], path.parent, cell.get("table")) if cameras and "cameras" in cell else None
        if rig is not None:
            opened.callback(rig.close)
        robot = _robot(cell, path.parent, rig)
        opened.pop_all()
    return robot


def _robot(cell: Mapping[str, Any], folder: Path, rig: Rig | None) -> Robot:
    tolerance = _tolerance(cell.get("tolerance", {}))
    limits = MotionLimits.from_file(cell["limits"]) if "limits" in cell else None
    calibration = Calibration.from_json(cell) if "base_to_world" in cell else None
    viewpoints = viewpoints_from_json(cell.get("viewpoints", []))
    made: Any = make_driver("arm", cell["arm"], DRIVERS, cell.get("options", {}))
    if not hasattr(made, "halt"):
        if "cameras" in cell:
            remedy = "a factory that returns a driver for Arm; the observe() of a Robot takes its pictures itself"
            raise InvalidInputError("cameras", "are given, but `arm` returns a Robot", remedy)
        robot: Robot = made
        return robot
    observe_scene = _scene_of(folder / cell["objects"]) if "objects" in cell else None
    return Arm(
        made,
        calibration=calibration,
        observe_scene=observe_scene,
        limits=limits,
        tolerance=tolerance,
        open_width_m=cell.get("open_width_m"),
        geometry=_geometry(folder, cell["urdf"]) if "urdf" in cell else None,
        reach_m=checked_bound("reach_m", cell["reach_m"]) if "reach_m" in cell else None,
        cameras=rig,
        viewpoints=viewpoints,
        on_lost=checked_on_lost(cell.get("lost_contact", "continue")),
    )


def read_cell(path: Path) -> dict[str, Any]:
    """A cell's file as a document; raises InvalidInputError if it is none, or has fields that are not known."""
    try:
        cell = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InvalidInputError("robot", f"{path}: {error}", "MODULE:FACTORY, or a cell's JSON file") from error
    if not isinstance(cell, dict) or not isinstance(cell.get("arm"), str):
        raise InvalidInputError("arm", "is missing", ", ".join(DRIVERS))
    if unknown := [name for name in cell if name not in CELL_FIELDS]:
        raise InvalidInputError(unknown[0], "is not known", ", ".join(CELL_FIELDS))
    return cell


def write_cell(path: Path, cell: Mapping[str, Any]) -> None:
    """Write a cell's file; whatever goes wrong, the old one or the new one is there as a whole."""
    begun = path.with_name(f"{path.name}.part")
    begun.write_text(json.dumps(cell, indent=1) + "\n")
    begun.replace(path)


def _tolerance(document: object) -> Tolerance:
    known = [field.name for field in fields(Tolerance)]
    if not isinstance(document, Mapping) or not set(document) <= set(known):
        raise InvalidInputError("tolerance", f"is {document!r:.80}", f"an object with {', '.join(known)}")
    return Tolerance(**document)


def _geometry(folder: Path, document: object) -> UrdfGeometry:
    if not isinstance(document, Mapping) or not {"file", "frame"} == set(document):
        raise InvalidInputError("urdf", f"is {document!r:.80}", '{"file": "arm.urdf", "frame": "tool0"}')
    return UrdfGeometry(folder / str(document["file"]), str(document["frame"]))


def _scene_of(path: Path) -> Callable[[], Observation]:
    """What the file says, read again at each look."""

    def look() -> Observation:
        return observation_from_file("objects", path)

    look()
    return look
