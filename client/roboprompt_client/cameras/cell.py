"""The `cameras`, `viewpoints` and `table` of a cell's file.

    "cameras": [{"name": "front", "driver": "realsense", "options": {"serial": "..."}, "camera_to_world": [[...], ...]},
                {"name": "wrist", "driver": "my_cell:make_camera", "camera_to_hand": null}],
    "viewpoints": [{"position": [0.4, 0.1, 1.1], "quaternion_xyzw": [1, 0, 0, 0]}],
    "table": {"position": [0.3, 0, 0.75], "normal": [0, 0, 1]}

A camera has `camera_to_world` where it stands still, and `camera_to_hand` where the hand carries it: (4, 4) in meters,
OpenCV axes (x right, y down, z forward), null until `roboprompt-robot calibrate` has found it.
"""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from roboprompt_client.arms.calibration import Calibration
from roboprompt_client.arrays import Array
from roboprompt_client.camera import checked_camera_pose
from roboprompt_client.cameras.rig import MountedCamera, Rig
from roboprompt_client.cameras.table import Table
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.extras import make_driver
from roboprompt_client.motion_limits import Pose
from roboprompt_client.wording import checked_name

DRIVERS = {
    "realsense": "roboprompt_client.cameras.realsense:RealSense",
    "opencv": "roboprompt_client.cameras.usb:UsbCamera",
    "files": "roboprompt_client.cameras.files:FrameFolder",
}
CAMERA_FIELDS = ("name", "driver", "options", "camera_to_world", "camera_to_hand")
MOUNTS = ("camera_to_world", "camera_to_hand")
ONE_CAMERA = '{"name": "front", "driver": "realsense", "camera_to_world": null}'
MAX_VIEWPOINTS = 8


def rig_from_json(document: object, folder: Path, table: object = None) -> Rig:
    """The cameras of a cell's file, opened.

    Args:
        folder: of the file: a folder of frames is relative to it.
        table: the cell's `table`, if there is one.

    Raises:
        InvalidInputError: if the document says something that cannot be.
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


def viewpoints_from_json(document: object) -> tuple[Pose, ...]:
    """Poses of the hand in the world; raises InvalidInputError for anything else."""
    if not isinstance(document, list) or len(document) > MAX_VIEWPOINTS:
        valid = f'at most {MAX_VIEWPOINTS} of {{"position": [x, y, z], "quaternion_xyzw": [x, y, z, w]}}'
        raise InvalidInputError("viewpoints", f"are {document!r:.80}", valid)
    found = []
    for k, item in enumerate(document):
        try:
            pose = Calibration.from_json({"base_to_world": item})
        except InvalidInputError as error:
            raise InvalidInputError(f"viewpoints[{k}]", error.message, error.valid) from error
        found.append(Pose(tuple(pose.position_m.tolist()), tuple(pose.quaternion_xyzw.tolist())))
    return tuple(found)


def _camera(k: int, document: object, folder: Path) -> MountedCamera:
    item: Mapping[str, Any] = document if isinstance(document, Mapping) else {}
    mounts = [name for name in MOUNTS if name in item]
    if not isinstance(item.get("driver"), str) or not isinstance(item.get("name"), str) or len(mounts) != 1:
        raise InvalidInputError(f"cameras[{k}]", f"is {document!r:.120}", f"{ONE_CAMERA} or camera_to_hand")
    name = checked_name(f"cameras[{k}].name", item["name"])
    if unknown := [key for key in item if key not in CAMERA_FIELDS]:
        raise InvalidInputError(f"cameras[{name}].{unknown[0]}", "is not known", ", ".join(CAMERA_FIELDS))
    mount = _mount(f"cameras[{name}].{mounts[0]}", item[mounts[0]])
    options = item.get("options", {})
    if item["driver"] == "files" and isinstance(options, Mapping) and isinstance(options.get("folder"), str):
        options = {**options, "folder": str(folder / options["folder"])}
    try:
        driver = make_driver(f"cameras[{name}].driver", item["driver"], DRIVERS, options)
    except CameraError as error:
        raise error.of(name) from error
    return MountedCamera(name, driver, mounts[0] == "camera_to_hand", mount)


def _mount(field: str, document: Any) -> Array | None:  # noqa: ANN401
    return None if document is None else checked_camera_pose(field, document)
