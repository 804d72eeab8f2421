"""Episodes and predictions for tests: small, different for every seed, the same every time."""

from dataclasses import asdict

import numpy as np

from app.perception.base import ObjectQuery
from app.services.task_settings import TaskSettings
from app.store import episodes, predictions, tasks
from app.store.records import EpisodeDraft, PredictionDraft
from app.store.values import CameraRecord, KeyframeRecord, ObjectRecord
from roboprompt_client.types.camera import Camera, camera_json
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory

TASK = "open_drawer"
SETTINGS = {"keyframes": {"rule": "merged", "delta_rad_s": 0.1}, "num_demonstrations": 10}
EXTRACTION_KEYS = TaskSettings.model_validate(SETTINGS).extraction_keys


def trajectory(num_frames=30, seed=0, optional_arrays=True):
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(num_frames, 4))
    return Trajectory(
        joint_velocities_rad_s=rng.normal(size=(num_frames, 7)),
        positions_m=rng.normal(size=(num_frames, 3)),
        quaternions_xyzw=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        gripper_open=rng.integers(0, 2, num_frames).astype(bool),
        timestamps_s=np.arange(num_frames) / 20 if optional_arrays else None,
        joint_positions_rad=rng.normal(size=(num_frames, 7)) if optional_arrays else None,
        object_positions_m=rng.normal(size=(num_frames, 3, 3)) if optional_arrays else None,
        object_quaternions_xyzw=np.tile([0.0, 0.6, 0.0, 0.8], (num_frames, 3, 1)) if optional_arrays else None,
        gripper_width_m=rng.uniform(0, 0.08, num_frames) if optional_arrays else None,
        wrenches_n_nm=rng.normal(size=(num_frames, 6)) if optional_arrays else None,
    )


def camera_record(**digests):
    camera_to_world = np.eye(4)
    camera_to_world[:3, 3] = 0.1, -1 / 3, 1.2
    return CameraRecord(camera_json(Camera("front", 500.5, 501.5, 320.0, 240.0, camera_to_world)), **digests)


def object_record(name, seed=0):
    rng = np.random.default_rng(seed)
    quaternion = None if seed % 2 else np.array([0.0, 0.6, 0.0, 0.8])
    return ObjectRecord.of(ObjectPose(name, rng.normal(size=3), quaternion, "masks", ("front", "wrist")))


def episode_draft(
    seed=0,
    task=TASK,
    instruction="open the bottom drawer",
    names=("drawer", "cube"),
    cameras=(),
):
    recorded = trajectory(seed=seed)
    return EpisodeDraft(
        task=task,
        instruction=instruction,
        control_frequency_hz=20.0,
        keyframes=tuple(KeyframeRecord.of(index, recorded.action_at(index)) for index in (5, 12, 29)),
        keyframes_key=EXTRACTION_KEYS.keyframes,
        poses_key=EXTRACTION_KEYS.poses,
        objects=tuple(object_record(name, seed) for name in names),
        given_objects=tuple({**asdict(ObjectQuery(name)), "mask_ids": [98, 99]} for name in names),
        cameras=cameras,
        extra={"operator": "Zoë", "seed": seed, "nested": [1, None, True]},
        num_frames=len(recorded),
        trajectory=npz_from_trajectory(recorded),
    )


def read(store, query, *arguments, **options):
    """The result of a query in a transaction of its own."""
    with store.read() as connection:
        return query(connection, *arguments, **options)


def write(store, query, *arguments, **options):
    """As `read`, of one that writes."""
    with store.write() as connection:
        return query(connection, *arguments, **options)


def upload(store, draft):
    with store.write() as connection:
        tasks.get_or_create(connection, draft.task, SETTINGS)
        return episodes.add(connection, draft)


def prediction_draft(task=TASK, **changes):
    values = {
        "task": task,
        "instruction": "open the bottom drawer",
        "model": "embedded/gemma-3-270m",
        "representation": "object_frame",
        "prompt_format": "paper",
        "status": "ok",
        "request": {"task": task, "objects": [{"name": "drawer", "position": [0.1, 0.2, 0.7]}]},
        "demonstration_ids": ("a" * 32, "b" * 32),
        "prompt_system": "You are a Franka Panda robot.",
        "prompt_user": "{'drawer': [42, 65, 29]}>",
        "reply_text": "[[46, 74, 55, 54, 36, 37, 1]]",
        "actions": ({"position": [0.1, 0.2, 0.3], "gripper_open": True, "bins": [46, 74, 55, 54, 36, 37, 1]},),
        "error": None,
        "usage": {"prompt_tokens": 2174, "cached_tokens": 2141, "completion_tokens": 40},
        "timings_ms": {"model": 312.5},
        "objects": (),
        "grounding": {"instruction": "open the bottom drawer", "phrases": []},
        "findings": (),
    }
    return PredictionDraft(**{**values, **changes})


def predict(store, draft):
    with store.write() as connection:
        tasks.get_or_create(connection, draft.task, SETTINGS)
        return predictions.add(connection, draft)


def blobs_of(store):
    """The digests of the images in a store's folder."""
    return {path.name for path in (store._data_dir / "blobs").glob("??/??/*")}
