"""Small hand-made episodes: a gripper that goes to an object, closes, and lifts."""

import io
import json
from itertools import pairwise

import cv2
import numpy as np

from roboprompt_client.types.trajectory import Trajectory

DOWN_XYZW = (1.0, 0.0, 0.0, 0.0)
DWELL, MOVE = 3, 4
RAD_S_PER_STEP_M = 20.0  # at 20 Hz 1 rad/s of one joint for 1 m/s of the hand


def one_joint(start_m, positions_m):
    """Joint velocities (T, 7) of an arm of which one joint moves the hand from `start_m` through the positions."""
    steps_m = np.linalg.norm(np.diff([start_m, *positions_m], axis=0), axis=1)
    return np.outer(RAD_S_PER_STEP_M * steps_m, np.eye(7)[0])


def pick_trajectory(position_m, lift_m=0.15):
    """Home, above the object, down, closed, lifted: rests between straight moves; four keyframes."""
    x, y, z = position_m
    return rests_at([(0.1, 0.0, 1.2, 1), (x, y, z + 0.1, 1), (x, y, z, 0), (x, y, z + lift_m, 0)])


def rests_at(poses):
    """The hand goes straight from the first of the poses (x, y, z, gripper open) to each other, and rests there."""
    positions, is_open = [], []
    for (*start, before), (*end, after) in pairwise(poses):
        positions += [np.array(start) + (np.array(end) - np.array(start)) * (k + 1) / MOVE for k in range(MOVE)]
        positions += [np.array(end)] * DWELL
        is_open += [before] * MOVE + [after] * DWELL
    velocities = one_joint(poses[0][:3], positions)
    return Trajectory(velocities, np.array(positions), np.tile(DOWN_XYZW, (len(positions), 1)), np.array(is_open))


def arrays(trajectory):
    """The arrays of a trajectory by their names in the file."""
    return {
        "joint_velocities": trajectory.joint_velocities_rad_s,
        "end_effector_positions": trajectory.positions_m,
        "end_effector_quaternions_xyzw": trajectory.quaternions_xyzw,
        "gripper_open": trajectory.gripper_open,
    }


def npz(**named):
    stream = io.BytesIO()
    np.savez_compressed(stream, **named)
    return stream.getvalue()


def metadata(task, objects, instruction="pick up the cube", **more):
    listed = [{"name": name, "position": list(position)} for name, position in objects.items()]
    return {"task": task, "instruction": instruction, "objects": listed, **more}


def multipart(document, trajectory_npz, **images):
    """The `files` of an httpx request."""
    files = {"metadata": ("metadata.json", json.dumps(document), "application/json")}
    if trajectory_npz is not None:
        files["trajectory"] = ("trajectory.npz", trajectory_npz)
    return {**files, **{name: (name, data) for name, data in images.items()}}


def upload(http, task, position_m, **more):
    """Upload a pick of one cube; returns the response."""
    document = metadata(task, {"cube": position_m}, **more)
    return http.post("/episodes", files=multipart(document, npz(**arrays(pick_trajectory(position_m)))))


def refused(response, field, words="", status=422):
    """The only error of a refusal: it names the field, and its message or what is valid has the words."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    (error,) = response.json()["errors"]
    assert error["field"] == field
    assert words in f"{error['message']} {error['valid']}"
    return error


def camera(name="front", width=64, height=48, f=60.0):
    """A camera 1 m above the origin of the world, looking down."""
    return {
        "name": name,
        "intrinsics": {"fx": f, "fy": f, "cx": (width - 1) / 2, "cy": (height - 1) / 2},
        "camera_to_world": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1.0], [0, 0, 0, 1]],
        "depth_scale": 0.001,
    }


def png(image):
    return cv2.imencode(".png", image)[1].tobytes()
