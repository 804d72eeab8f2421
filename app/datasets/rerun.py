"""Episodes -> a `.rrd` file for the rerun viewer: paths, speeds, gripper, objects and the first frame's images."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import MissingPackageError, in_one_step
from app.datasets.parcel import Parcel
from roboprompt_client.camera import camera_from_json
from roboprompt_client.trajectory import Trajectory
from roboprompt_client.trajectory_npz import trajectory_from_npz

MEDIA_TYPES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
OBJECT_RADIUS_M = 0.01


def write_rerun(target: Path, parcels: Iterable[Parcel]) -> int:
    """Write the file; returns the number of episodes. Raises MissingPackageError, or DatasetError if it cannot."""
    try:
        import rerun
    except ImportError as error:
        raise MissingPackageError("rerun files", "rerun-sdk") from error
    number = 0
    with in_one_step(target) as unfinished:
        stream = rerun.RecordingStream("roboprompt")
        stream.save(unfinished)
        for number, parcel in enumerate(parcels, 1):
            root = f"episode_{number - 1:06d}"
            _log_scene(rerun, stream, root, parcel)
            rate_hz = float(parcel.metadata["control_frequency_hz"])
            _log_trajectory(rerun, stream, root, trajectory_from_npz(parcel.files["trajectory"]), rate_hz)
        stream.flush()
        stream.disconnect()
    return number


def _log_scene(rerun: Any, stream: Any, root: str, parcel: Parcel) -> None:  # noqa: ANN401
    stream.log(f"{root}/instruction", rerun.TextDocument(str(parcel.metadata["instruction"])), static=True)
    placed = [item for item in parcel.metadata["objects"] if item.get("position") is not None]
    if placed:
        positions_m, labels = [item["position"] for item in placed], [item["name"] for item in placed]
        points = rerun.Points3D(positions_m, labels=labels, radii=OBJECT_RADIUS_M)
        stream.log(f"{root}/world/objects", points, static=True)
    for document in parcel.metadata["cameras"]:
        camera = camera_from_json(document)
        where = f"{root}/world/{camera.name}"
        pose = camera.camera_to_world
        stream.log(where, rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]), static=True)
        lens = rerun.Pinhole(focal_length=[camera.fx_px, camera.fy_px], principal_point=[camera.cx_px, camera.cy_px])
        stream.log(where, lens, static=True)
        rgb = parcel.files.get(f"rgb_{camera.name}", b"")
        media = next((kind for magic, kind in MEDIA_TYPES.items() if rgb.startswith(magic)), None)
        if media is not None:
            stream.log(f"{where}/rgb", rerun.EncodedImage(contents=rgb, media_type=media), static=True)


def _log_trajectory(rerun: Any, stream: Any, root: str, trajectory: Trajectory, rate_hz: float) -> None:  # noqa: ANN401
    path = rerun.LineStrips3D([trajectory.positions_m])
    stream.log(f"{root}/world/path", path, static=True)
    speeds_rad_s = np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1)
    for frame in range(len(trajectory)):
        time_s = frame / rate_hz if trajectory.timestamps_s is None else float(trajectory.timestamps_s[frame])
        stream.set_time("time", duration=time_s)
        pose = rerun.Transform3D(
            translation=trajectory.positions_m[frame],
            quaternion=rerun.Quaternion(xyzw=trajectory.quaternions_xyzw[frame]),
        )
        stream.log(f"{root}/world/end_effector", pose)
        stream.log(f"{root}/joint_speed_rad_s", rerun.Scalars(speeds_rad_s[frame]))
        stream.log(f"{root}/gripper_open", rerun.Scalars(float(trajectory.gripper_open[frame])))
