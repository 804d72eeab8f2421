"""A cell's file: the arm, its base, its limits, the objects and the cameras.

    {"arm": "franka", "options": {"address": "172.16.0.2"},
     "base_to_world": {"position": [0, 0, 0.6], "quaternion_xyzw": [0, 0, 0, 1]},
     "limits": {"workspace": {"min": [0.2, -0.4, 0.6], "max": [0.7, 0.4, 1.2]}},
     "objects": "objects.json", "tolerance": {"position_m": 0.005, "max_contact_force_n": 30}, "open_width_m": 0.08,
     "reach_m": 0.85, "urdf": {"file": "arm.urdf", "frame": "tool0"},
     "cameras": [{"name": "front", "driver": "realsense", "options": {"serial": ".."}, "camera_to_world": [[...], ...]},
                 {"name": "wrist", "driver": "my_cell:make_camera", "camera_to_hand": null}],
     "viewpoints": [{"position": [0.4, 0, 1.1], "quaternion_xyzw": [1, 0, 0, 0]}],
     "table": {"position": [0.3, 0, 0.75], "normal": [0, 0, 1]}}

Only `arm` is needed; it may also be MODULE:FACTORY, a callable that returns a Robot or a driver for `Arm`. A camera has
`camera_to_world` if it stands still and `camera_to_hand` if the hand carries it: (4, 4) in meters, OpenCV axes (x
right, y down, z forward), null until `roboprompt-robot calibrate` has found it.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Calibration, Driver
from roboprompt_client.arms.safety import Tolerance
from roboprompt_client.arms.urdf import UrdfGeometry
from roboprompt_client.cameras.rig import MountedCamera, Rig
from roboprompt_client.cameras.table import Table
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.extras import make_driver
from roboprompt_client.motion.limits import MotionLimits, checked_bound
from roboprompt_client.robot import Robot, observation_from_file
from roboprompt_client.types.camera import checked_camera_pose
from roboprompt_client.types.names import checked_name
from roboprompt_client.types.poses import Pose
from roboprompt_client.types.trajectory import MAX_GRIPPER_WIDTH_M

ARMS = {
    "franka": "roboprompt_client.arms.franka:Franka",
    "ur": "roboprompt_client.arms.ur:UR",
    "xarm": "roboprompt_client.arms.xarm:XArm",
    "ros": "roboprompt_client.arms.ros:Ros",
}
CAMERAS = {
    "realsense": "roboprompt_client.cameras.realsense:RealSense",
    "opencv": "roboprompt_client.cameras.opencv:UsbCamera",
    "files": "roboprompt_client.cameras.opencv:FrameFolder",
}
OF_ARM = ("arm", "options", "base_to_world", "limits", "objects", "tolerance", "open_width_m", "reach_m", "urdf")
CELL_FIELDS = (*OF_ARM, "cameras", "viewpoints", "table")
MOUNTS = ("camera_to_world", "camera_to_hand")
CAMERA_FIELDS = ("name", "driver", "options", *MOUNTS)
ONE_CAMERA = '{"name": "front", "driver": "realsense", "camera_to_world": null}'
ONE_VIEWPOINT = '{"position": [x, y, z], "quaternion_xyzw": [x, y, z, w]}'
MAX_VIEWPOINTS = 8
MOST_M = {"open_width_m": MAX_GRIPPER_WIDTH_M, "reach_m": 10.0}  # larger numbers are no meters


def open_robot(name: str, *, cameras: bool = True) -> Robot:
    """Return the robot of MODULE:FACTORY or of a cell's file.

    Args:
        cameras: whether to open the cell's cameras, too; without them its arm does not go to viewpoints, either.

    Raises:
        InvalidInputError: if the factory does not exist, or the file is invalid.
        MotionError: if the arm cannot be reached.
        CameraError: if a camera cannot be opened.
    """
    path = Path(name)
    cell: Mapping[str, Any] = {"arm": name} if ":" in name and not path.exists() else read_cell(path)
    with ExitStack() as opened:
        rig = rig_from_json(cell["cameras"], path.parent, cell.get("table")) if cameras and "cameras" in cell else None
        if rig is not None:
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


def _robot(cell: Mapping[str, Any], folder: Path, rig: Rig | None, opened: ExitStack) -> Robot:
    """Return the robot; `opened` closes its driver if the arm then cannot be used."""
    how: dict[str, Any] = {
        "calibration": Calibration.from_json(cell) if "base_to_world" in cell else None,
        "limits": MotionLimits.from_file(cell["limits"]) if "limits" in cell else None,
        "tolerance": _tolerance(cell.get("tolerance", {})),
        "geometry": _geometry(folder, cell["urdf"]) if "urdf" in cell else None,
        "viewpoints": viewpoints_from_json(cell.get("viewpoints", [])),
        **{name: checked_bound(name, cell[name], most_m) for name, most_m in MOST_M.items() if name in cell},
    }
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


def _geometry(folder: Path, document: object) -> UrdfGeometry:
    if not isinstance(document, Mapping) or not {"file", "frame"} == set(document):
        raise InvalidInputError("urdf", f"is {document!r:.80}", '{"file": "arm.urdf", "frame": "tool0"}')
    return UrdfGeometry.read(folder / str(document["file"]), str(document["frame"]))


def rig_from_json(document: object, folder: Path, table: object = None) -> Rig:
    """Open the `cameras` of a cell's file.

    Args:
        folder: of the file; folders of frames are relative to it.
        table: the cell's `table`, if there is one.

    Raises:
        InvalidInputError: if the document is malformed.
        CameraError: if a camera cannot be opened.
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


def viewpoints_from_json(document: object) -> tuple[Pose, ...]:
    """Return poses of the hand in the world frame; raises InvalidInputError if the document is malformed."""
    if not isinstance(document, list) or len(document) > MAX_VIEWPOINTS:
        raise InvalidInputError("viewpoints", f"are {document!r:.80}", f"at most {MAX_VIEWPOINTS} of {ONE_VIEWPOINT}")
    found = []
    for k, item in enumerate(document):
        try:
            pose = Calibration.from_json({"base_to_world": item})
        except InvalidInputError as error:
            raise InvalidInputError(f"viewpoints[{k}]", error.message, ONE_VIEWPOINT) from error
        found.append(Pose(pose.position_m, pose.quaternion_xyzw))
    return tuple(found)
