import errno
import gc
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.store.data_folder import Turns, UnderWay, UnderWayNotes
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


def note(name, started_s=0.0, left_s=60.0):
    return UnderWay(name, "pick", "pick up the cube", "regression", started_s, time.time() + left_s)


def test_what_began_is_seen_by_others_until_it_ends(tmp_path):
    mine, others = UnderWayNotes(tmp_path / "notes"), UnderWayNotes(tmp_path / "notes")
    assert others.all() == ()
    later, earlier = note("b", 2.0), note("a", 1.0)
    mine.begin(later)
    mine.begin(earlier)
    assert others.all() == (earlier, later)
    mine.end("a")
    mine.end("a")
    assert others.all() == (later,)


def test_what_a_dead_process_left_behind_goes_at_its_deadline(tmp_path):
    notes = UnderWayNotes(tmp_path)
    notes.begin(note("dead", left_s=-1))
    notes.begin(living := note("living"))
    assert notes.all() == (living,)
    assert [path.name for path in tmp_path.iterdir()] == ["living.json"]


def test_a_folder_of_notes_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreUnavailableError, match="under way"):
        UnderWayNotes(tmp_path / "file").begin(note("a"))


def test_files_of_killed_holders_are_swept_and_those_of_living_ones_stay(tmp_path):
    turns = Turns(tmp_path)
    (tmp_path / "left by a killed process").touch()
    with turns.take("a") as held:
        turns.sweep()
        assert list(tmp_path.iterdir()) == [held._path]


def test_half_a_note_hides_no_other_and_goes(tmp_path):
    notes = UnderWayNotes(tmp_path)
    notes.begin(living := note("living"))
    (tmp_path / "young.json").write_text('{"id": "you')
    (old := tmp_path / "old.json").write_text("\0\0")
    os.utime(old, (0, 0))
    assert notes.all() == (living,)
    assert {path.name for path in tmp_path.iterdir()} == {"living.json", "young.json"}


def test_a_note_that_cannot_be_deleted_is_not_shown(tmp_path, monkeypatch):
    notes = UnderWayNotes(tmp_path)
    notes.begin(note("dead", left_s=-1))

    def read_only(*_arguments, **_options):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "unlink", read_only)
    assert notes.all() == ()
    with Turns(tmp_path / "turns").take("a"):
        pass


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
