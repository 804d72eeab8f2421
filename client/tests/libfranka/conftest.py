import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.franka import Franka

ADDRESS = "127.0.61.1"
FAST = 0.3  # of the arm's dynamics: a simulated arm is harmless


class Simulated:
    """The process of a simulated arm."""

    def __init__(self):
        self.process = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("simulated.py"), ADDRESS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout.readline() == "ready\n"

    def tell(self, command):
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "done\n"

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


@contextmanager
def opened(dynamics=FAST, **settings):
    with Arm(Franka(ADDRESS, dynamics=dynamics, realtime=False), **settings) as arm:
        yield arm


@pytest.fixture
def simulated():
    arm = Simulated()
    yield arm
    arm.kill()


@pytest.fixture
def arm(simulated):
    with opened() as arm:
        yield arm
