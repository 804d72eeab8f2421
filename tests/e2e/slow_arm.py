"""A robot for `roboprompt-robot run --robot`: it writes what it is to do into the file that ARM_LOG names."""

import os
import time
from pathlib import Path

import numpy as np

from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import ObjectPose


class SlowArm:
    """Takes ARM_SECONDS for a motion."""

    def observe(self):
        return Observation((ObjectPose("cube", np.array([0.213, -0.117, 0.78])),))

    def execute(self, action):
        self._note(f"to {action.position_m[2]:.3f}")
        time.sleep(float(os.environ.get("ARM_SECONDS", "0")))

    def stop(self):
        self._note("stop")

    def _note(self, line):
        with Path(os.environ["ARM_LOG"]).open("a") as log:
            log.write(f"{line}\n")
