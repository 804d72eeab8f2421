"""A cell's file: the arm, its base, its limits, the objects and the cameras.

    {"arm": "franka", "options": {"address": "172.16.0.2"},
     "base_to_world": {"position": [0, 0, 0.6], "quaternion_xyzw": [0, 0, 0, 1]},
     "limits": {"workspace": {"min": [0.2, -0.4, 0.6], "max": [0.7, 0.4, 1.2]}},
     "objects": "objects.json", "tolerance": {"position_m": 0.005, "max_contact_force_n": 30}, "open_width_m": 0.08,
     "cameras": [{"name": "front", "driver": "realsense", "options": {"serial": ".."}, "camera_to_world": [[...], ...]},
                 {"name": "wrist", "driver": "my_cell:make_camera", "camera_to_hand": null}],
     "table": {"position": [0.3, 0, 0.75], "normal": [0, 0, 1]}}

Only `arm` is needed; it may also be MODULE:FACTORY, a callable that returns a Robot or a driver for `Arm`. A camera has
`camera_to_world` if it stands still and `camera_to_hand` if the hand carries it: (4, 4) in meters, OpenCV axes (x
right, y down, z forward), null until `roboprompt-robot calibrate` has found it.
"""

import importlib
import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm, Tolerance
from roboprompt_client.arms.driver import Calibration, Driver
from roboprompt_client.cameras.rig import MountedCamera, Rig
from roboprompt_client.cameras.table import Table
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.motion.limits import MotionLimits, checked_bound
from roboprompt_client.robot import Robot, observation_from_file
from roboprompt_client.types.camera import checked_camera_pose
from roboprompt_client.types.names import checked_name
from roboprompt_client.types.trajectory import MAX_GRIPPER_WIDTH_M

ARMS = {"franka": "roboprompt_client.arms.franka:Franka", "ur": "roboprompt_client.arms.ur:UR"}
CAMERAS = {
    "realsense": "roboprompt_client.cameras.realsense:RealSense",
    "files": "roboprompt_client.cameras.files:FrameFolder",
}
OF_ARM = ("arm", "options", "base_to_world", "limits", "objects", "tolerance", "open_width_m")
CELL_FIELDS = (*OF_ARM, "cameras", "table")
MOUNTS = ("camera_to_world", "camera_to_hand")
CAMERA_FIELDS = ("name", "driver", "options", *MOUNTS)
ONE_CAMERA = '{"name": "front", "driver": "realsense", "camera_to_world": null}'


def open_robot(name: str, *, cameras: bool = True) -> Robot:
    """Return the robot of MODULE:FACTORY or of a cell's file, whose cameras are opened unless told otherwise.

    Raises:
        InvalidInputError: if the factory does not exist, or the file is invalid.
        MotionError: if the arm cannot be reached.
        CameraError: if a camera cannot be opened.
    """
    path = Path(name)
    cell: Mapping[str, Any] = {"arm": name} if ":" in name and not path.exists() else read_cell(path)
    with ExitStack() as opened:
        wanted = cameras and "cameras" in cell
        rig = rig_from_json(cell["cameras"], path.parent, cell.get("table")) if wanted else Rig()
        opened.callback(rig.close)
        robot = _robot(cell, path.parent, rig, opened)
        opened.pop_all()
    return robot


@contextmanager
def closing_robot(robot: Robot) -> Iterator[Robot]:
    """Yield the robot; in the end stop and close it, with its cameras, if it is an `Arm`."""
    try:
        yield robot
    finally:
        if isinstance(robot, Arm):
            robot.close()


def _robot(cell: Mapping[str, Any], folder: Path, rig: Rig, opened: ExitStack) -> Robot:
    """Return the robot; `opened` closes its driver if the arm then cannot be used."""
    how: dict[str, Any] = {"tolerance": _tolerance(cell.get("tolerance", {}))}
    if "open_width_m" in cell:
        how["open_width_m"] = checked_bound("open_width_m", cell["open_width_m"], MAX_GRIPPER_WIDTH_M)
    if "base_to_world" in cell:
        how["calibration"] = Calibration.from_json(cell)
    if "limits" in cell:
        how["limits"] = MotionLimits.from_file(cell["limits"])
    if "objects" in cell:
        if not isinstance(cell["objects"], str):
            raise InvalidInputError("objects", f"is {cell['objects']!r:.80}", "the name of a JSON file")
        how["observe_scene"] = partial(observation_from_file, "objects", folder / cell["objects"])
        how["observe_scene"]()  # and again at each observation
    made: Any = make_driver("arm", cell["arm"], ARMS, cell.get("options", {}))
    if hasattr(made, "halt"):
        _require_members("arm", made, Driver)
        opened.callback(made.close)
        return Arm(made, cameras=rig, **how)
    if ignored := [name for name in cell if name not in ("arm", "options")]:
        remedy = "a factory that returns a driver for Arm; a Robot has its own cameras, limits and objects"
        raise InvalidInputError(ignored[0], "is given, but `arm` returns a Robot", remedy)
    _require_members("arm", made, Robot)
    robot: Robot = made
    return robot


def make_driver(field: str, name: str, known: Mapping[str, str], options: object) -> Any:  # noqa: ANN401
    """Return the driver that a factory makes of options by name: one of the `known`, or MODULE:FACTORY.

    Raises InvalidInputError, naming `field` (``cameras[front].driver``), if there is none, or for other options.
    """
    module, colon, factory = known.get(name, name).partition(":")
    valid = ", ".join([*known, "MODULE:FACTORY"])
    if not colon:
        raise InvalidInputError(field, f"is {name!r:.80}", valid)
    try:
        make = getattr(importlib.import_module(module), factory)
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidInputError(field, f"{name!r:.80} cannot be imported: {error}", valid) from error
    within, dot, _ = field.rpartition(".")
    options_field = f"{within}{dot}options"
    if not isinstance(options, Mapping):
        raise InvalidInputError(options_field, f"are {options!r:.80}", "an object")
    try:
        return make(**options)
    except TypeError as error:
        raise InvalidInputError(options_field, f"do not fit {name}: {error}") from error


def _require_members(field: str, made: object, protocol: type) -> None:
    """Raise InvalidInputError, naming `field`, if an object lacks members of a protocol."""
    members = (*getattr(protocol, "__annotations__", ()), *(name for name in vars(protocol) if name[0] != "_"))
    if missing := [name for name in members if not hasattr(made, name)]:
        message = f"makes a {type(made).__name__}, which lacks {', '.join(missing)}"
        raise InvalidInputError(field, message, f"a {protocol.__name__}: see {protocol.__module__}")


def read_cell(path: Path) -> dict[str, Any]:
    """Return a cell's file as a JSON object; raises InvalidInputError if it is malformed, or has unknown fields."""
    try:
        cell = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InvalidInputError("robot", f"{path}: {error}", "MODULE:FACTORY, or a cell's JSON file") from error
    if not isinstance(cell, dict) or not isinstance(cell.get("arm"), str):
        raise InvalidInputError("arm", "is missing", ", ".join([*ARMS, "MODULE:FACTORY"]))
    if unknown := [name for name in cell if name not in CELL_FIELDS]:
        raise InvalidInputError(unknown[0], "is not known", ", ".join(CELL_FIELDS))
    return cell


def write_cell(path: Path, cell: Mapping[str, Any]) -> None:
    """Write a cell's file; after an error the old file is there unchanged."""
    begun = path.with_name(f"{path.name}.part")
    begun.write_text(json.dumps(cell, indent=1) + "\n")
    begun.replace(path)


def _tolerance(document: object) -> Tolerance:
    known = [field.name for field in fields(Tolerance)]
    if not isinstance(document, Mapping) or not set(document) <= set(known):
        raise InvalidInputError("tolerance", f"is {document!r:.80}", f"an object with {', '.join(known)}")
    return Tolerance(**document)


def rig_from_json(document: object, folder: Path, table: object = None) -> Rig:
    """Open the `cameras` of a cell's file in `folder`; `table` is the cell's, if there is one.

    Raises InvalidInputError if the document is malformed, and CameraError if a camera cannot be opened.
    """
    if not isinstance(document, list) or not document:
        raise InvalidInputError("cameras", f"is {document!r:.80}", f"a list, each as {ONE_CAMERA}")
    with ExitStack() as opened:
        cameras = []
        for k, item in enumerate(document):
            cameras.append(_camera(k, item, folder))
            opened.callback(cameras[-1].driver.close)
        rig = Rig(cameras, None if table is None else Table.from_json(table))
        opened.pop_all()
    return rig


def _camera(k: int, document: object, folder: Path) -> MountedCamera:
    item: Mapping[str, Any] = document if isinstance(document, Mapping) else {}
    mounts = [name for name in MOUNTS if name in item]
    if not isinstance(item.get("driver"), str) or not isinstance(item.get("name"), str) or len(mounts) != 1:
        raise InvalidInputError(f"cameras[{k}]", f"is {document!r:.120}", f"{ONE_CAMERA} or camera_to_hand")
    name, mount = checked_name(f"cameras[{k}].name", item["name"]), mounts[0]
    if unknown := [key for key in item if key not in CAMERA_FIELDS]:
        raise InvalidInputError(f"cameras[{name}].{unknown[0]}", "is not known", ", ".join(CAMERA_FIELDS))
    pose = None if item[mount] is None else checked_camera_pose(f"cameras[{name}].{mount}", item[mount])
    options = item.get("options", {})
    if item["driver"] == "files" and isinstance(options, Mapping) and isinstance(options.get("folder"), str):
        options = {**options, "folder": str(folder / options["folder"])}
    try:
        driver = make_driver(f"cameras[{name}].driver", item["driver"], CAMERAS, options)
    except CameraError as error:
        raise error.of(name) from error
    return MountedCamera(name, driver, mount == "camera_to_hand", pose)
