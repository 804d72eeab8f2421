import gc
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from app.store.data_folder import Turns
from app.store.errors import CorruptDataError, ForbiddenTaskError, NotFoundError, StoreUnavailableError

HOLDER = """
import sys
from pathlib import Path
from app.store.data_folder import Turns
turn = Turns(Path(sys.argv[1])).take("a")
print("taken" if turn else "refused", flush=True)
sys.stdin.read()
"""


def test_one_at_a_time(tmp_path):
    turns = Turns(tmp_path / "turns")
    first = turns.take("a")
    assert first is not None
    assert turns.take("a") is None
    other = turns.take("b")
    assert other is not None
    with first, other:
        assert Turns(tmp_path / "turns").take("a") is None
    again = turns.take("a")
    assert again is not None
    with again:
        pass
    assert list((tmp_path / "turns").iterdir()) == []


def test_a_turn_that_is_dropped_is_left(tmp_path):
    turns = Turns(tmp_path)
    assert turns.take("a") is not None
    gc.collect()
    assert turns.take("a") is not None


def test_a_process_that_dies_leaves_its_turn(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert holder.stdout is not None
    assert holder.stdin is not None
    assert holder.stdout.readline() == "taken\n"
    assert Turns(tmp_path).take("a") is None
    holder.kill()
    holder.wait()
    assert Turns(tmp_path).take("a") is not None
    holder.stdin.close()
    holder.stdout.close()


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreUnavailableError, match="turns of requests"):
        Turns(tmp_path / "file" / "turns").take("a")


def test_files_of_killed_holders_are_swept_and_those_of_living_ones_stay(tmp_path):
    turns = Turns(tmp_path)
    (tmp_path / "left by a killed process").touch()
    with turns.take("a") as held:
        turns.sweep()
        assert list(tmp_path.iterdir()) == [held._path]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (NotFoundError("task", "a"), "there is no task 'a'"),
        (CorruptDataError("blob", "a", "gone"), "stored blob a is damaged: gone; restore it from a backup"),
        (ForbiddenTaskError("a", ["b", "c"]), "the key is not for the task 'a', only for 'b', 'c'"),
    ],
)
def test_errors_of_workers_reach_their_parent(error, text):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), text, vars(error))
