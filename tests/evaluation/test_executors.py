import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor
from contextlib import closing
from pathlib import Path

import pytest

from app.evaluation.run import SIMULATION
from app.executors import LocalExecutor, call
from app.sim.rendering import opengl_works
from tests.evaluation.processes import alive

PARENT = """
import os, time
from app.executors import LocalExecutor
if __name__ == "__main__":
    executor = LocalExecutor(imports=())
    print(executor.submit(os.getpid).result(), flush=True)
    time.sleep(60)
"""


def process_id(wait_s=0.0):
    time.sleep(wait_s)
    return os.getpid()


def divide(a, b):
    return a / b


def die_once(marker):
    """Kill the own process, but only the first time."""
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "survived"


def die(marker):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture(scope="module")
def executor():
    with closing(LocalExecutor(imports=SIMULATION)) as local:
        yield local


def test_work_happens_elsewhere(executor):
    assert call(executor, divide, 6, 3) == 2
    assert call(executor, process_id) != os.getpid()
    assert executor.workers >= 1


def imported(module):
    return module in sys.modules


def test_workers_begin_with_the_simulation_imported(executor):
    """On Linux; elsewhere each imports for itself."""
    assert call(executor, imported, "app.evaluation.trials") == (sys.platform == "linux")


def test_workers_render_as_this_process_does(executor):
    assert call(executor, opengl_works) == opengl_works()


def test_a_job_whose_process_died_is_run_again(executor, tmp_path):
    assert call(executor, die_once, str(tmp_path / "died")) == "survived"
    with pytest.raises(BrokenExecutor):
        call(executor, die, "")
    assert call(executor, divide, 6, 3) == 2


def test_workers_leave_ctrl_c_to_the_parent(executor):
    worker = call(executor, process_id)
    os.kill(worker, signal.SIGINT)
    assert call(executor, divide, 6, 3) == 2
    os.kill(worker, 0)  # still there


def test_workers_end_with_a_parent_that_was_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment) as parent:
        workers = [int(word) for word in parent.stdout.readline().split()]
        parent.kill()
    assert workers
    deadline = time.monotonic() + 10
    while any(map(alive, workers)):
        assert time.monotonic() < deadline, f"workers {workers} outlived their parent"
        time.sleep(0.05)
