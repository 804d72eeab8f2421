"""Every condition tried on every task: asked over HTTP, carried out in the simulation."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from app.sim.demonstrate import record_demonstration, rollout, view_scene
from app.sim.outcomes import RecordedDemonstration, SceneView
from app.sim.tasks import TASKS
from benchmarks.findings.conditions import CONDITIONS, Condition, Teaching
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import EndEffectorAction

DEMONSTRATIONS = 10
UNSEEN_FROM = 100_000  # scenes are drawn from so many seeds after the demonstrations
TASK_STEP = 100  # between the scenes' seeds of one task and of the next: errors are drawn from them, too


@dataclass(frozen=True)
class Attempt:
    """One scene under one condition.

    Attributes:
        refusal: the problem that the service answered with instead of actions; empty where it answered.
        failure: why the scene was not solved.
        findings: of the answer.
    """

    condition: str
    task: str
    seed: int
    refusal: str = ""
    succeeded: bool = False
    failure: str = ""
    findings: tuple[dict[str, Any], ...] = ()


@dataclass
class Outcomes:
    """What became of actions in a scene, kept in a file: other findings about the same actions need no simulation."""

    path: Path
    known: dict[str, tuple[bool, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for line in self.path.read_text().splitlines() if self.path.exists() else ():
            entry = json.loads(line)
            self.known[entry["key"]] = entry["succeeded"], entry["failure"]

    def of(self, task: str, seed: int, actions: Sequence[EndEffectorAction]) -> tuple[bool, str]:
        """Whether the scene is solved, and why not."""
        commanded = [[a.position_m.tolist(), a.quaternion_xyzw.tolist(), a.gripper_open] for a in actions]
        key = hashlib.sha256(json.dumps([task, seed, commanded]).encode()).hexdigest()
        if key not in self.known:
            result = rollout(task, seed, actions, variation=TASKS[task].test_variation(seed))
            self.known[key] = result.succeeded, result.failure
            entry = {"key": key, "succeeded": result.succeeded, "failure": result.failure}
            with self.path.open("a") as file:
                file.write(json.dumps(entry) + "\n")
        return self.known[key]


def trials(
    client: RoboPromptClient, tasks: Sequence[str], first_seed: int, episodes: int, outcomes: Outcomes
) -> Iterator[Attempt]:
    """Every trial; tasks that the service knows already are not taught again."""
    for number, task in enumerate(tasks):
        recorded: dict[str, list[RecordedDemonstration]] = {}
        scenes = [_scene(task, first_seed + UNSEEN_FROM + number * TASK_STEP + k) for k in range(episodes)]
        for condition in CONDITIONS:
            if number % condition.one_in:
                continue
            name = f"{task}.{condition.lesson.name}.{first_seed}"
            if not _is_taught(client, name):
                demonstrations = recorded.setdefault(condition.lesson.recordings, [])
                demonstrations += [] if demonstrations else _record(task, condition.lesson, first_seed)
                _teach(client, name, condition.lesson, demonstrations)
            for scene in scenes:
                if (trial := _try(client, name, condition, scene, outcomes)) is not None:
                    yield trial


def _scene(task: str, seed: int) -> SceneView:
    return view_scene(task, seed, variation=TASKS[task].test_variation(seed), images=False)


def _is_taught(client: RoboPromptClient, name: str) -> bool:
    try:
        return bool(client.get(f"/tasks/{name}")["num_episodes"] == DEMONSTRATIONS)
    except ServiceProblemError:
        return False


def _record(task: str, lesson: Teaching, first_seed: int) -> list[RecordedDemonstration]:
    found: list[RecordedDemonstration] = []
    for seed in count(first_seed):
        recorded = record_demonstration(task, seed, images=False, recordings=lesson.recordings)
        found += [recorded] if recorded.succeeded else []
        if len(found) == DEMONSTRATIONS:
            break
    return found


def _teach(client: RoboPromptClient, name: str, lesson: Teaching, recorded: Sequence[RecordedDemonstration]) -> None:
    symmetry = dict(TASKS[recorded[0].scene.task].yaw_symmetry_deg)
    client.configure_task(name, yaw_symmetry_deg=symmetry, num_demonstrations=DEMONSTRATIONS)
    for item, poses in zip(recorded, lesson.taught_poses(recorded), strict=True):
        trajectory = replace(item.trajectory, object_positions_m=None, object_quaternions_xyzw=None)
        frequency_hz = item.control_frequency_hz
        client.upload(name, item.scene.instruction, trajectory, Observation(poses), control_frequency_hz=frequency_hz)


def _try(
    client: RoboPromptClient, name: str, condition: Condition, scene: SceneView, outcomes: Outcomes
) -> Attempt | None:
    seen = condition.seen(scene)
    if seen is None:
        return None
    trial = Attempt(condition.name, scene.task, scene.seed)
    try:
        predicted = client.predict(name, condition.words(scene.instruction), Observation(seen), **condition.options)
    except ServiceProblemError as error:
        return replace(trial, refusal=f"{error.status} {error.problem.get('type', '').rpartition('/')[2]}")
    succeeded, failure = outcomes.of(scene.task, scene.seed, predicted.actions)
    findings = tuple(dict(finding) for finding in predicted.findings)
    return replace(trial, succeeded=succeeded, failure=failure, findings=findings)
