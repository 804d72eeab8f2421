"""A simulated Research 3 that speaks libfranka's protocol on a loopback address: `python simulated.py ADDRESS`.

Commands on its standard input: `jam` and `free` for the fingers.
"""

import sys
import threading

import franky_sim
from franky_sim.mujoco_simulator import MujocoSimulator


def main() -> None:
    """Serve until the input ends."""
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot()
        with franky_sim.SimulationServer(simulator, hostname_candidates=[sys.argv[1]]) as server:
            server.run_async()
            print("ready", flush=True)
            listen(robot)


def listen(robot: franky_sim.BaseRobot) -> None:
    """Do what is said."""
    move, jammed = robot.set_hand_goal, threading.Event()
    robot.set_hand_goal = lambda *goal: None if jammed.is_set() else move(*goal)
    for line in sys.stdin:
        jammed.set() if line.strip() == "jam" else jammed.clear()
        print("done", flush=True)


if __name__ == "__main__":
    main()
