"""A program that moves the arm to and fro until it is ended: `python mover.py ADDRESS DYNAMICS`."""

import sys

import numpy as np

from roboprompt_client import EndEffectorAction
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.franka import Franka
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.runs.loop import run_closed_loop

HOME_M, DOWN = np.array([0.5, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])


class Service:
    """Answers with one action after the other."""

    def __init__(self):
        self._asked = 0

    def predict(self, *_, **__):
        self._asked += 1
        offset = np.array([0.06, 0.0, -0.06]) * (self._asked % 2)
        action = EndEffectorAction(HOME_M + offset, DOWN, bool(self._asked % 2))
        return type("Answer", (), {"actions": (action,), "findings": (), "id": "p", "response": {}})


def main():
    with Arm(Franka(sys.argv[1], dynamics=float(sys.argv[2]), realtime=False)) as arm:
        print("ready", flush=True)
        for _ in run_closed_loop(Service(), arm, "t", "go", limits=MotionLimits(hand_radius_m=0.0), max_steps=1000):
            print("moving", flush=True)


if __name__ == "__main__":
    main()
