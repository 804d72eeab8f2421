"""Demonstrations and rollouts as in `app.sim.demonstrate`, carried out by the Franka driver over libfranka's protocol.

Every way to a pose is straight: the driver knows no other. What is recorded is what the driver reports.
"""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from app.sim.demonstrate import view_scene
from app.sim.libfranka.served import ServedScene
from app.sim.moves import action_from_move
from app.sim.outcomes import RecordedDemonstration, RolloutResult
from app.sim.tasks import ALL_TASKS, make_task
from roboprompt_client.arms.arm import Arm
from roboprompt_client.errors import MotionError
from roboprompt_client.recording.recorder import Recorder
from roboprompt_client.trajectory import EndEffectorAction

REST_S = 0.2  # after each pose, so that keyframe rules see it


def record_demonstration(
    task: str, seed: int, control_frequency_hz: float = 20.0, *, images: bool = True
) -> RecordedDemonstration:
    """Let the driver carry out the expert's poses in the scene of a seed, and record it.

    Raises:
        InvalidInputError: for an unknown task, a frequency below 20 Hz, or where franky is not installed.
        MotionError: if the scene cannot be served.
    """
    actions = tuple(map(action_from_move, make_task(task, seed).expert()))
    scene = view_scene(task, seed, images=images)
    with _served(task, seed) as served, served.open_arm() as arm, tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(arm, Path(folder) / "journal", control_frequency_hz)
        recorder.start()
        _, error = _perform(arm, actions, rest_s=REST_S)
        trajectory = recorder.stop()
        failure = error or served.judge()
    return RecordedDemonstration(
        scene, trajectory, control_frequency_hz, len(actions), not failure, failure, (), actions
    )


def rollout(
    task: str, seed: int, actions: Sequence[EndEffectorAction], *, variation: int | None = None
) -> RolloutResult:
    """Let the driver carry out predicted actions on the scene of a seed, and judge the outcome.

    An action that the driver refuses, or that does not arrive, ends the rollout as a failure that names it.

    Raises:
        InvalidInputError: for an unknown task or variation, or where franky is not installed.
        MotionError: if the scene cannot be served.
    """
    with _served(task, seed, variation) as served, served.open_arm() as arm:
        misses, error = _perform(arm, actions)
        failure = error or served.judge()
    return RolloutResult(task, seed, len(misses), not failure, failure, (), tuple(misses))


def _served(task: str, seed: int, variation: int | None = None) -> ServedScene:
    of_seed = seed % ALL_TASKS[task].variations
    return ServedScene(task, seed, of_seed if variation is None else variation)


def _perform(
    arm: Arm, actions: Sequence[EndEffectorAction], rest_s: float = 0.0
) -> tuple[list[tuple[float, float]], str]:
    """How far off each action's pose the arm ended, m and degrees, and the error that ended them (empty: none)."""
    misses: list[tuple[float, float]] = []
    for index, action in enumerate(actions):
        try:
            arm.execute(action)
        except MotionError as error:
            return misses, f"action {index + 1} of {len(actions)}: {error}"
        misses.append(arm.state().distance_to(action.position_m, action.quaternion_xyzw))
        time.sleep(rest_s)
    return misses, ""
