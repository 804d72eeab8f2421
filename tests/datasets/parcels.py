"""Episodes as they are uploaded, with everything that an upload can have."""

from dataclasses import replace

import numpy as np

from app.datasets.parcel import ObjectEntry, Parcel
from roboprompt_client.types.camera import camera_from_json
from tests.episodes import camera, pick_trajectory, png

PLACES_M = ((0.1, 0.0, 0.8), (0.2, -0.1, 0.8), (0.3, 0.1, 0.8))


def recorded(place_m, everything=True):
    """A pick with joint positions, times, fingers, forces and the cube's track."""
    trajectory = pick_trajectory(place_m)
    if not everything:
        return trajectory
    frames = len(trajectory)
    rng = np.random.default_rng(7)
    tracks_m = np.tile(place_m, (frames, 1, 1)) + rng.normal(0, 1e-3, (frames, 1, 3))
    return replace(
        trajectory,
        joint_positions_rad=rng.normal(size=(frames, 7)),
        timestamps_s=np.arange(frames) / 20 + 0.003,
        object_positions_m=tracks_m,
        object_quaternions_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (frames, 1, 1)),
        gripper_width_m=np.where(trajectory.gripper_open, 0.08, 0.04),
        wrenches_n_nm=rng.normal(size=(frames, 6)),
    )


def parcel(place_m=PLACES_M[0], task="pick", instruction="pick up the cube", everything=True):
    """One episode with a color and a depth image."""
    rng = np.random.default_rng(1)
    images = {
        "rgb_front": png(rng.integers(0, 255, (48, 64, 3), np.uint8)),
        "depth_front": png(rng.integers(500, 900, (48, 64), np.uint16)),
    }
    return Parcel.of(
        task=task,
        instruction=instruction,
        trajectory=recorded(place_m, everything),
        control_frequency_hz=20.0,
        objects=(ObjectEntry("cube", tuple(place_m)),),
        cameras=(camera_from_json(camera()),),
        images=images,
        extra={"operator": "me"},
    )


def parcels():
    return [parcel(place_m) for place_m in PLACES_M]
