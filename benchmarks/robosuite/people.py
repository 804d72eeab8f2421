"""Recordings of people who drove robosuite's arms, read from a folder; nothing of them is part of this project."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.sim.outcomes import RecordedDemonstration, SceneView
from benchmarks.robosuite.scene import TASKS, Floats, gripper_open
from roboprompt_client.types.poses import ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

TABLE_OF_2018_M = (-0.56, 0.0, 0.0)  # robosuite 0.1 had its world frame in the arm's base, 1.0 in the table
SETTLED_S = 0.5  # objects fall onto the table first


@dataclass(frozen=True)
class PeopleTask:
    """Recordings of one task.

    Attributes:
        simulated: the task in whose scenes predictions are carried out.
        files: one for each demonstration.
        bodies: the recorded names of the task's objects, in its order; any of several.
    """

    simulated: str
    files: tuple[str, ...]
    bodies: tuple[tuple[str, ...], ...]


PEOPLE: Mapping[str, PeopleTask] = {
    "lift_by_people": PeopleTask("lift", tuple(f"lift_panda_{k}.npz" for k in range(1, 9)), (("cube", "cube_main"),)),
    "stack_by_people": PeopleTask(
        "stack", ("stack_panda_1.npz", "stack_sawyer_1.npz", "stack_sawyer_2.npz"), (("cubeA",), ("cubeB",))
    ),
}


def recorded_by_people(folder: Path, task: str, number: int) -> RecordedDemonstration:
    """The recording of that number as it was made, its world frame moved into the table.

    Raises:
        IndexError: if there are fewer recordings.
        OSError: if the folder has no such file.
    """
    recorded, name = PEOPLE[task], PEOPLE[task].files[number]
    data = np.load(folder / name)
    moved_m = np.array(TABLE_OF_2018_M if "sawyer" in name else (0.0, 0.0, 0.0))
    places_m, turns = data["end_effector_positions"] + moved_m, data["end_effector_quaternions_xyzw"]
    times_s = np.asarray(data["timestamps"], np.float64)
    widths_m = np.asarray(data["gripper_width_m"], np.float64)
    trajectory = Trajectory(data["joint_velocities"], places_m, turns, gripper_open(widths_m), times_s)
    names, settled = data["object_names"].tolist(), int(np.searchsorted(times_s, SETTLED_S))
    objects = []
    for body, known in zip(TASKS[recorded.simulated].bodies, recorded.bodies, strict=True):
        row = next(names.index(other) for other in known if other in names)
        place_m: Floats = data["object_positions"][row, settled] + moved_m
        objects.append(ObjectPose(body.name, place_m, data["object_quaternions_xyzw"][row, settled]))
    hand = Pose(tuple(map(float, places_m[0])), tuple(map(float, turns[0])))
    view = SceneView(task, number, TASKS[recorded.simulated].instruction, tuple(objects), (), {}, hand)
    frequency_hz = (len(times_s) - 1) / float(times_s[-1])
    return RecordedDemonstration(view, trajectory, frequency_hz, True, "")
