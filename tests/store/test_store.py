import os
import signal
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest

from app.store import episodes, labels, tasks
from app.store.errors import StoreUnavailableError
from app.store.labels import LabelRecord
from app.store.store import Store, blob_digests

from .drafts import SETTINGS, TASK, blobs_of, camera_record, episode_draft, read, upload, write

AT_ONCE = timedelta(0)
# Uploads without end; says after each commit which episode is safe. Every third time it stops before the commit.
UPLOADER = """
import os, sys
from pathlib import Path
from app.store import episodes, tasks
from app.store.store import Store
from tests.store.drafts import camera_record, episode_draft
store = Store.open(Path(sys.argv[1]))
for number in range(10_000):
    digest = store.blobs.put(os.urandom(2000))
    with store.write() as connection:
        tasks.get_or_create(connection, "open_drawer", {})
        draft = episode_draft(number, cameras=(camera_record(rgb_digest=digest),))
        added = episodes.add(connection, draft)
        if number == 5:
            print("uncommitted", added.id, digest, flush=True)
            sys.stdin.read()
    print("committed", added.id, digest, flush=True)
"""


def test_ping(store):
    store.ping()


def test_ping_notices_that_the_file_is_gone(sqlite_store, tmp_path):
    sqlite_store.close()
    for path in (tmp_path / "data").glob("roboprompt.db*"):
        path.unlink()
    with pytest.raises(StoreUnavailableError, match="no such table"):
        sqlite_store.ping()


def test_sweep_keeps_the_images_of_episodes(store):
    kinds = ("rgb", "depth", "mask")
    digests = {f"{kind}_digest": store.blobs.put(kind.encode()) for kind in kinds}
    orphan = store.blobs.put(b"orphan")
    episode = upload(store, episode_draft(cameras=(camera_record(**digests), camera_record())))
    upload(store, episode_draft())
    assert store.sweep() == 0
    assert store.sweep(AT_ONCE) == 1
    assert [store.blobs.read(digest) for digest in digests.values()] == [b"rgb", b"depth", b"mask"]
    write(store, episodes.remove, episode.id)
    assert store.sweep(AT_ONCE) == 3
    assert store.blobs.put(b"orphan") == orphan


def test_other_database(tmp_path):
    store = Store.open(tmp_path / "data", f"sqlite:///{tmp_path / 'elsewhere.db'}")
    episode = upload(store, episode_draft())
    store.close()
    assert (tmp_path / "elsewhere.db").exists()
    assert not (tmp_path / "data" / "roboprompt.db").exists()
    again = Store.open(tmp_path / "data", f"sqlite:///{tmp_path / 'elsewhere.db'}")
    assert read(again, episodes.get, episode.id) == episode
    again.close()


def test_killed_before_the_commit_leaves_only_orphans(tmp_path):
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", UPLOADER, str(tmp_path)]
    with subprocess.Popen(command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline().split() for _ in range(6)]
        os.kill(process.pid, signal.SIGKILL)
    assert [line[0] for line in lines] == ["committed"] * 5 + ["uncommitted"]
    store = Store.open(tmp_path)
    with store.read() as connection:
        assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
        assert list(reversed(episodes.list_ids(connection, "open_drawer"))) == [line[1] for line in lines[4::-1]]
        assert blob_digests(connection) == {line[2] for line in lines[:5]}
    assert len(store.blobs.read(lines[5][2])) == 2000
    assert store.sweep(AT_ONCE) == 1
    assert all(len(store.blobs.read(line[2])) == 2000 for line in lines[:5])
    store.close()


def test_sweep_keeps_masks_and_templates(store):
    """Of labels, and of object models in the settings."""
    mask, template, orphan = (store.blobs.put(data) for data in (b"mask", b"template", b"orphan"))
    with store.write() as connection:
        model = {"estimator": "registered", "template": template}
        tasks.get_or_create(connection, TASK, {**SETTINGS, "object_models": {"drawer": model}})
        labels.add(connection, LabelRecord(TASK, "drawer", (camera_record(mask_digest=mask),), {"front": 7}, 30.0))
    assert read(store, blob_digests) == {mask, template}
    assert store.sweep(AT_ONCE) == 1
    assert orphan not in blobs_of(store)


@pytest.mark.parametrize("damaged", ["\0" * 17, "17a", "99999999999.0"])
def test_a_damaged_note_of_the_last_sweep_does_not_end_sweeping(store, monkeypatch, damaged):
    (store._data_dir / ".swept").write_text(damaged)
    monkeypatch.setattr(store, "sweep", lambda: 7)
    assert [store.sweep_once(), store.sweep_once()] == [7, 0]


def test_a_disk_that_refuses_the_note_of_a_sweep_is_an_error_of_the_store(store):
    (store._data_dir / ".swept").mkdir()
    with pytest.raises(StoreUnavailableError):
        store.sweep_once()
