"""Recordings of people who drove robosuite's arms, read from a folder; nothing of them is part of this project."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.sim.outcomes import RecordedDemonstration, SceneView
from benchmarks.robosuite.arm import Floats, gripper_open
from benchmarks.robosuite.scene import TASKS
from roboprompt_client.types.poses import ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

SETTLED_S = 0.5  # objects fall onto the table first


@dataclass(frozen=True)
class PeopleTask:
    """Recordings of one task.

    Attributes:
        simulated: the task in whose scenes predictions are carried out.
        files: one for each demonstration.
        bodies: the recorded names of the task's objects, in its order; any of several. Those that never move are among
            the recording's `static_names`.
    """

    simulated: str
    files: tuple[str, ...]
    bodies: tuple[tuple[str, ...], ...]


PEOPLE: Mapping[str, PeopleTask] = {
    "lift_by_people": PeopleTask("lift", tuple(f"lift_panda_{k}.npz" for k in range(1, 9)), (("cube", "cube_main"),)),
    "stack_by_people": PeopleTask(
        "stack", ("stack_panda_1.npz", "stack_sawyer_1.npz", "stack_sawyer_2.npz"), (("cubeA",), ("cubeB",))
    ),
    "nuts_by_people": PeopleTask(
        "both_nuts",
        ("nutassembly_panda_1.npz", "nutassembly_sawyer_1.npz", "nutassembly_sawyer_2.npz"),
        (("SquareNut0",), ("RoundNut0",), ("peg1",), ("peg2",)),
    ),
    "objects_by_a_person": PeopleTask(
        "four_objects", ("pickplace_panda_1.npz",), (("Milk0",), ("Bread0",), ("Cereal0",), ("Can0",), ("bin2",))
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
    still = dict(zip(data["static_names"].tolist(), np.asarray(data["static_positions"], np.float64), strict=True))
    table_m = still.get("table", np.zeros(3))
    moved_m = np.array([-table_m[0], -table_m[1], 0.0])  # robosuite 0.1 had its world frame in the arm's base
    places_m, turns = data["end_effector_positions"] + moved_m, data["end_effector_quaternions_xyzw"]
    times_s = np.asarray(data["timestamps"], np.float64)
    widths_m = np.asarray(data["gripper_width_m"], np.float64)
    trajectory = Trajectory(data["joint_velocities"], places_m, turns, gripper_open(widths_m), times_s)
    names, settled = data["object_names"].tolist(), int(np.searchsorted(times_s, SETTLED_S))
    objects = []
    for body, known in zip(TASKS[recorded.simulated].bodies, recorded.bodies, strict=True):
        found = next(other for other in known if other in names or other in still)
        place_m: Floats = still[found] if found in still else data["object_positions"][names.index(found), settled]
        turned = (0, 0, 0, 1) if found in still else data["object_quaternions_xyzw"][names.index(found), settled]
        objects.append(ObjectPose(body.name, place_m + moved_m, np.asarray(turned, np.float64)))
    hand = Pose(places_m[0], turns[0])
    view = SceneView(task, number, TASKS[recorded.simulated].instruction, tuple(objects), (), {}, hand)
    frequency_hz = (len(times_s) - 1) / float(times_s[-1])
    return RecordedDemonstration(view, trajectory, frequency_hz, True, "")
