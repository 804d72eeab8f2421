"""A scene's process, seen from the robot's program."""

import os
import subprocess
import sys
from typing import Self

import numpy as np

from app.sim.tasks.base import NOT_SOLVED
from app.sim.world import BASE_POSITION_M
from roboprompt_client import quaternions as rotations
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.franka import Franka
from roboprompt_client.errors import MotionError

DYNAMICS = 0.3  # of the arm's own limits; a simulated arm endangers no person
END_S = 5.0


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
