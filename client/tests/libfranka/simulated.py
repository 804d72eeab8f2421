"""A simulated Research 3 that speaks libfranka's protocol on a loopback address: `python simulated.py ADDRESS`.

Commands on its standard input: `jam` and `free` for the fingers, `push` and `release` for a hand that pushes the arm's.
"""

import sys
import threading

import franky_sim
import mujoco
from franky_sim.mujoco_simulator import MujocoSimulator
from in_step import InStepServer

PUSH_N = 8.0


def main() -> None:
    """Serve until the input ends."""
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot()
        with InStepServer(simulator, hostname_candidates=[sys.argv[1]]) as server:
            server.run_async()
            print("ready", flush=True)
            listen(robot)


def listen(robot: franky_sim.BaseRobot) -> None:
    """Do what is said."""
    move, jammed = robot.set_hand_goal, threading.Event()
    robot.set_hand_goal = lambda *goal: None if jammed.is_set() else move(*goal)
    commands = {
        "jam": jammed.set,
        "free": jammed.clear,
        "push": lambda: push(robot, PUSH_N),
        "release": lambda: push(robot, 0.0),
    }
    for line in sys.stdin:
        commands[line.strip()]()
        print("done", flush=True)


def push(robot: franky_sim.BaseRobot, along_y_n: float) -> None:
    """A force on the arm's hand, world frame."""
    names = [mujoco.mj_id2name(robot.model, mujoco.mjtObj.mjOBJ_BODY, body) for body in range(robot.model.nbody)]
    hand = next(body for body, name in enumerate(names) if name.endswith("hand"))
    robot.data.xfrc_applied[hand, 1] = along_y_n


if __name__ == "__main__":
    main()
