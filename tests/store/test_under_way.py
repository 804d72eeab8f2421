import time

import pytest

from app.store.errors import StoreUnavailableError
from app.store.processes import UnderWay, UnderWayNotes


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


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreUnavailableError, match="under way"):
        UnderWayNotes(tmp_path / "file").begin(note("a"))
