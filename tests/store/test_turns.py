import gc
import subprocess
import sys
from pathlib import Path

import pytest

from app.store.errors import StoreUnavailableError
from app.store.processes import Turns

HOLDER = """
import sys
from pathlib import Path
from app.store.processes import Turns
turn = Turns(Path(sys.argv[1])).take("a")
print("taken" if turn else "refused", flush=True)
sys.stdin.read()
"""


def test_one_at_a_time(tmp_path: Path) -> None:
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


def test_a_turn_that_is_dropped_is_left(tmp_path: Path) -> None:
    turns = Turns(tmp_path)
    assert turns.take("a") is not None
    gc.collect()
    assert turns.take("a") is not None


def test_a_process_that_dies_leaves_its_turn(tmp_path: Path) -> None:
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


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreUnavailableError, match="turns of requests"):
        Turns(tmp_path / "file" / "turns").take("a")
