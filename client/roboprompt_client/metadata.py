"""Cameras and objects <-> the JSON of an upload's metadata."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from roboprompt_client.camera import Camera
from roboprompt_client.trajectory import ObjectPose


def object_json(pose: ObjectPose) -> dict[str, Any]:
    """An object with the pose that the robot knows."""
    quaternion = None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist()
    return {"name": pose.name, "position": pose.position_m.tolist(), "quaternion_xyzw": quaternion}


def camera_json(camera: Camera) -> dict[str, Any]:
    """A camera's calibration."""
    intrinsics = {"fx": camera.fx_px, "fy": camera.fy_px, "cx": camera.cx_px, "cy": camera.cy_px}
    if camera.image_size_px is not None:
        intrinsics["width"], intrinsics["height"] = camera.image_size_px
    return {
        "name": camera.name,
        "intrinsics": intrinsics,
        "camera_to_world": camera.camera_to_world.tolist(),
        "depth_scale": camera.depth_scale,
    }


def camera_from_json(value: Mapping[str, Any]) -> Camera:
    """The inverse of `camera_json`.

    Raises:
        InvalidInputError: for a calibration that Camera refuses.
        KeyError, TypeError: for a document of another form.
    """
    k = value["intrinsics"]
    size = (k["width"], k["height"]) if k.get("width") is not None and k.get("height") is not None else None
    numbers = (k["fx"], k["fy"], k["cx"], k["cy"])
    transform = np.asarray(value["camera_to_world"], dtype=np.float64)
    return Camera(value["name"], *numbers, transform, value.get("depth_scale", 0.001), size)
