"""A program that moves the arm to and fro until it is ended: `python mover.py ADDRESS DYNAMICS`."""

import sys

import numpy as np

from roboprompt_client import EndEffectorAction
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.franka import Franka
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.runs.loop import run_task

HOME_M, DOWN = np.array([0.5, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])


class Service:
    """Answers with a hundred actions, which no limits bound."""

    def motion_limits(self, task):
        return MotionLimits(hand_radius_m=0.0)

    def predict(self, *_, **__):
        offsets = [np.array([0.06, 0.0, -0.06]) * (k % 2) for k in range(1, 101)]
        actions = tuple(EndEffectorAction(HOME_M + offset, DOWN, bool(k % 2)) for k, offset in enumerate(offsets, 1))
        return type("Answer", (), {"actions": actions, "findings": (), "id": "p", "response": {}})


def say_moving(index, action):
    print("moving", flush=True)
    return True


def main():
    with Arm(Franka(sys.argv[1], dynamics=float(sys.argv[2]), realtime=False)) as arm:
        print("ready", flush=True)
        run_task(Service(), arm, "t", "go", confirm=say_moving)


if __name__ == "__main__":
    main()
