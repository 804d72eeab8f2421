"""Demonstrations and rollouts as in `app.sim.demonstrate`, carried out by the Franka driver over libfranka's protocol.

Every way to a pose is straight: the driver knows no other. What is recorded is what the driver reports.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np

from app.sim.demonstrate import view_scene
from app.sim.moves import action_from_move
from app.sim.outcomes import RecordedDemonstration, RolloutResult
from app.sim.tasks import ALL_TASKS, make_task
from app.sim.tasks.base import NOT_SOLVED
from app.sim.world import BASE_POSITION_M, CAMERA_NAMES
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.franka import Franka
from roboprompt_client.errors import MotionError
from roboprompt_client.recording.recorder import Recorder
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.poses import EndEffectorAction

DYNAMICS = 0.3  # of the arm's own limits; a simulated arm endangers no person
END_S = 5.0
REST_S = 0.2  # after each pose, so that keyframe rules see it
POLL_S = 0.005


class ServedScene:
    """A task's scene behind libfranka's protocol on a loopback address; a context manager.

    Args:
        address: None: a free one.

    Raises:
        MotionError: if its process does not start, or has ended.
    """

    def __init__(self, task: str, seed: int, variation: int, address: str | None = None) -> None:
        scene = (task, str(seed), str(variation), *([] if address is None else [address]))
        command = [sys.executable, "-m", "app.sim.libfranka.serve", *scene]
        paths = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        # A session of its own: Ctrl-C is for the robot's program, which stops the arm over the protocol.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=paths, start_new_session=True
        )
        self.address = self._read()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    def open_arm(self) -> Arm:
        """The scene's arm, in the world frame, as a laboratory's program would open it."""
        driver = Franka(self.address, model="panda", dynamics=DYNAMICS, realtime=False)
        return Arm(driver, calibration=Calibration(np.array(BASE_POSITION_M), rotations.IDENTITY))

    def judge(self) -> str:
        """Why the scene is not solved once things came to rest; empty if it is."""
        assert self._process.stdin is not None
        self._process.stdin.write("judge\n")
        self._process.stdin.flush()
        return "" if self._read() == "solved" else NOT_SOLVED

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise MotionError("the simulated arm's process has ended")
        return line.strip()


def record_demonstration(
    task: str, seed: int, control_frequency_hz: float = 20.0, *, images: bool = True
) -> RecordedDemonstration:
    """Let the driver carry out the expert's poses in the scene of a seed, and record it.

    Raises:
        InvalidInputError: for an unknown task, a frequency below 20 Hz, or where franky is not installed.
        MotionError: if the scene cannot be served.
    """
    actions = tuple(map(action_from_move, make_task(task, seed).expert()))
    scene = view_scene(task, seed, cameras=CAMERA_NAMES if images else ())
    with _served(task, seed) as served, served.open_arm() as arm, tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(arm, Path(folder) / "journal", control_frequency_hz)
        recorder.start()
        _, error = _perform(arm, actions, rest_s=REST_S)
        trajectory = recorder.stop()
        failure = error or served.judge()
    return RecordedDemonstration(scene, trajectory, control_frequency_hz, not failure, failure, actions)


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
    return RolloutResult(len(misses), not failure, failure, misses=tuple(misses))


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
        _rest(arm, rest_s)
    return misses, ""


def _rest(arm: Arm, rest_s: float) -> None:
    """Wait for a time of the simulation, which is slower than real time on a busy machine."""
    end_s = (arm.state().time_s or 0.0) + rest_s
    while rest_s and (arm.state().time_s or end_s) < end_s:
        time.sleep(POLL_S)
