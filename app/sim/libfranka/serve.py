"""Serves one scene in a process of its own: `python -m app.sim.libfranka.serve TASK SEED VARIATION [ADDRESS]`.

It prints the loopback address on which franky-sim's servers speak libfranka's protocol for the scene's arm. A line on
its standard input asks for judgment: things come to rest, and it prints whether the task is solved. It ends with its
input.
"""

import os
import sys
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from threading import Thread

import franky_sim
import mujoco
import numpy as np
from franky_sim.base_simulator import InnerRobotState

from app.sim import panda
from app.sim.libfranka.in_step import InStepServer
from app.sim.tasks import make_task
from app.sim.tasks.base import FINAL_HOLD_S, SimTask
from roboprompt_client.types.arrays import Array

ENDED = ""
STEP_S = 0.001  # libfranka's
# Torques are computed once a step. Damping as critical as the links' inertia allows is stable at that rate.
STIFFNESS_NM_RAD = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
DAMPING_NM_S_RAD = (160.0, 160.0, 90.0, 90.0, 30.0, 30.0, 30.0)
WITHOUT_GRAVITY = franky_sim.RobotParameters(gravity=(0.0, 0.0, 0.0))  # our links' weight is compensated already
HELD_UP_M = 0.003  # a finger so far behind its target has met something


class ScenePanda(franky_sim.BaseRobot):
    """The scene's arm, driven by joint torques; its fingers follow a target that moves as quickly as commanded.

    Fingers that meet something press with the scene's own grip force, whatever force was commanded.
    """

    def __init__(self, task: SimTask) -> None:
        super().__init__(WITHOUT_GRAVITY, STIFFNESS_NM_RAD, DAMPING_NM_S_RAD)
        self._data = task.data
        joints = [task.model.joint(name) for name in panda.JOINT_NAMES]
        self._positions = [joint.qposadr[0] for joint in joints]
        self._velocities = [joint.dofadr[0] for joint in joints]
        self._fingers = [task.model.joint(name).qposadr[0] for name in panda.FINGER_NAMES]
        self._goal_m, self._finger_m_s = float(task.data.ctrl[panda.GRIPPER_CTRL]), 0.0

    def set_hand_goal(self, width: float, max_velocity: float, max_force: float) -> None:
        """Let the fingers go to a width between them, m; `max_force` is not simulated."""
        self._goal_m = float(np.clip(width / 2, 0.0, panda.FINGER_TRAVEL_M))
        self._finger_m_s = max_velocity / 2

    def _get_hand_width(self) -> float:
        return float(self._data.qpos[self._fingers].sum())

    def _get_state(self) -> InnerRobotState:
        read = (self._data.qpos[self._positions], self._data.qvel[self._velocities])
        return InnerRobotState(*(tuple(values.tolist()) for values in (*read, self._torques_nm)))

    @property
    def _torques_nm(self) -> Array:
        torques: Array = self._data.qfrc_applied[self._velocities]
        return torques

    def _torque_control(self, torques: Array) -> None:
        self._data.qfrc_applied[self._velocities] = np.clip(torques, -panda.MAX_TORQUE_NM, panda.MAX_TORQUE_NM)

    def _pre_step(self) -> None:
        target_m = float(self._data.ctrl[panda.GRIPPER_CTRL])
        most_m = self._finger_m_s * STEP_S
        moved_m = target_m + float(np.clip(self._goal_m - target_m, -most_m, most_m))
        held_up = abs(target_m - self._data.qpos[self._fingers[0]]) > HELD_UP_M
        self._data.ctrl[panda.GRIPPER_CTRL] = self._goal_m if held_up else moved_m


class SceneSimulator(franky_sim.BaseSimulator):
    """A task's scene, which franky-sim's server steps; the task notes what happens, as in the direct simulation."""

    def __init__(self, task: SimTask) -> None:
        super().__init__()
        self._task = task
        self._panda = ScenePanda(task)

    def _get_robots(self) -> list[ScenePanda]:
        return [self._panda]

    def _start(self) -> None:
        """Torques take the place of the scene's own servos."""
        model = self._task.model
        model.opt.timestep = STEP_S
        model.actuator_gainprm[: panda.NUM_JOINTS] = 0.0
        model.actuator_biasprm[: panda.NUM_JOINTS] = 0.0

    def _step(self) -> None:
        mujoco.mj_step(self._task.model, self._task.data)
        self._task.latch()


def main() -> None:
    """Step the scene in real time, or more slowly beside busy programs, until the input ends."""
    name, seed, variation, *address = sys.argv[1:]
    task = make_task(name, int(seed), int(variation))
    asked: SimpleQueue[str] = SimpleQueue()
    Thread(target=_listen, args=(asked,), daemon=True).start()
    with SceneSimulator(task) as simulator, InStepServer(simulator, address or addresses()) as server:
        _say(server.robot_servers[0].hostname)
        while True:
            server.run_once()
            try:
                request = asked.get_nowait()
            except Empty:
                continue
            if request == ENDED:
                return
            _judge(server, task)


def addresses() -> Iterator[str]:
    """Loopback addresses to try; the protocol's ports are fixed, so that each scene needs an address of its own."""
    for number in range(os.getpid(), os.getpid() + 1000):
        yield f"127.62.{number // 254 % 254}.{number % 254 + 1}"


def _judge(server: franky_sim.SimulationServer, task: SimTask) -> None:
    for _ in range(round(FINAL_HOLD_S / STEP_S)):
        server.run_once()
    _say("solved" if task.succeeded() else "not solved")


def _listen(asked: "SimpleQueue[str]") -> None:
    for line in sys.stdin:
        asked.put(line)
    asked.put(ENDED)


def _say(word: str) -> None:
    print(word, flush=True)  # noqa: T201 - the other process reads it


if __name__ == "__main__":
    main()
