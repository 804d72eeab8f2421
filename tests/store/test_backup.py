import hashlib
import json
import sqlite3
import tarfile

import pytest
from sqlalchemy import select
from typer.testing import CliRunner

from app.cli import application
from app.store import episodes, idempotency, predictions
from app.store.backup import back_up, restore
from app.store.errors import ConflictError, CorruptDataError, SchemaVersionError, StoreUnavailableError
from app.store.store import Store, blob_digests
from app.store.tables import metadata

from .drafts import camera_record, episode_draft, predict, prediction_draft, read, upload


def fill(store):
    for seed in range(3):
        digest = store.blobs.put(f"image {seed}".encode())
        film = {"front": store.blobs.put(f"film {seed}".encode())}
        upload(store, episode_draft(seed, cameras=(camera_record(rgb_digest=digest),), films=film))
    seen = store.blobs.put(b"seen")
    added = predict(store, prediction_draft(cameras=(camera_record(rgb_digest=seen),)))
    with store.write() as connection:
        predictions.record_outcome(connection, added.id, True, "Zoë \N{ROBOT FACE}")
        idempotency.save(connection, "POST /episodes", "key", "d" * 64, {"id": "a"})
    store.blobs.put(b"orphan")


def digest_of(store):
    """Of every row, and of every blob that one refers to."""
    digest = hashlib.sha256()
    with store.read() as connection:
        for table in metadata.sorted_tables:
            for row in connection.execute(select(table).order_by(*table.primary_key)).mappings():
                digest.update(repr(dict(row)).encode())
        for blob in sorted(blob_digests(connection)):
            digest.update(store.blobs.read(blob))
    return digest.hexdigest()


@pytest.fixture
def open_new(tmp_path, postgres):
    """Opens an empty store on either database."""
    opened = []

    def open_store(kind):
        url = postgres.migrated() if kind == "postgres" else None
        opened.append(Store.open(tmp_path / f"data{len(opened)}", url))
        return opened[-1]

    yield open_store
    for store in opened:
        store.close()


@pytest.mark.parametrize(("source", "target"), [("sqlite", "sqlite"), ("sqlite", "postgres"), ("postgres", "sqlite")])
def test_what_was_backed_up_comes_back(tmp_path, open_new, source, target):
    store = open_new(source)
    fill(store)
    before = digest_of(store)
    summary = back_up(store, tmp_path / "backup.tar")
    assert summary.num_blobs == 7
    assert summary.rows["episodes"] == 3
    restored = open_new(target)
    assert restore(restored, tmp_path / "backup.tar") == summary
    assert digest_of(restored) == before
    assert upload(restored, episode_draft(9)).sequence == 4
    assert {path.name for path in tmp_path.iterdir()} == {"backup.tar", "data0", "data1"}


def test_backup_is_of_one_moment(tmp_path, open_new, monkeypatch):
    store = open_new("sqlite")
    fill(store)
    read = store.blobs.read

    def read_while_others_upload(digest):
        upload(store, episode_draft(7))
        return read(digest)

    monkeypatch.setattr(store.blobs, "read", read_while_others_upload)
    assert back_up(store, tmp_path / "backup.tar").rows["episodes"] == 3
    restored = open_new("sqlite")
    assert restore(restored, tmp_path / "backup.tar").rows["episodes"] == 3


def test_restoring_over_something_is_refused(tmp_path, open_new):
    store = open_new("sqlite")
    fill(store)
    back_up(store, tmp_path / "backup.tar")
    before = digest_of(store)
    with pytest.raises(ConflictError, match=r"something already \(.*\): restore into an empty one"):
        restore(store, tmp_path / "backup.tar")
    assert digest_of(store) == before


def rewrite(path, change):
    """Write the archive again with changed members."""
    with tarfile.open(path) as archive:
        members = [(item.name, archive.extractfile(item).read()) for item in archive]
    with tarfile.open(path, "w:") as archive:
        for name, data in members:
            if (changed := change(name, data)) is not None:
                file = path.with_name("member")
                file.write_bytes(changed[1])
                archive.add(file, changed[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda name, data: (name, data if name.endswith(".db") else b"x" + data), "do not match its name"),
        (lambda name, data: None if name.startswith("blobs/") else (name, data), "lacks 7 blobs"),
        (lambda name, data: None if name.endswith(".db") else (name, data), r"has no roboprompt\.db"),
        (lambda name, data: (f"../{name}", data), "does not belong there"),
        (lambda name, data: (name, b"not a database" * 99 if name.endswith(".db") else data), "not a database"),
    ],
)
def test_damaged_backup_restores_nothing(tmp_path, open_new, change, message):
    store, path = open_new("sqlite"), tmp_path / "backup.tar"
    fill(store)
    back_up(store, path)
    rewrite(path, change)
    restored = open_new("sqlite")
    with pytest.raises(CorruptDataError, match=message):
        restore(restored, path)
    assert read(restored, episodes.list_page).items == ()


@pytest.mark.parametrize("length", [0, 100, 3000])
def test_cut_file_is_refused(tmp_path, open_new, length):
    store, path = open_new("sqlite"), tmp_path / "backup.tar"
    fill(store)
    back_up(store, path)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises((CorruptDataError, StoreUnavailableError)):
        restore(open_new("sqlite"), path)


def test_backup_of_newer_code_is_refused(tmp_path, open_new):
    def from_the_future(name, data):
        if name == "roboprompt.db":
            (tmp_path / name).write_bytes(data)
            with sqlite3.connect(tmp_path / name) as connection:
                connection.execute("UPDATE alembic_version SET version_num = '9999'")
            connection.close()
            data = (tmp_path / name).read_bytes()
        return name, data

    back_up(open_new("sqlite"), tmp_path / "backup.tar")
    rewrite(tmp_path / "backup.tar", from_the_future)
    with pytest.raises(SchemaVersionError, match="at revision 9999"):
        restore(open_new("sqlite"), tmp_path / "backup.tar")


def test_backup_that_cannot_be_written_leaves_the_last_one(tmp_path, open_new):
    store, path = open_new("sqlite"), tmp_path / "backup.tar"
    fill(store)
    back_up(store, path)
    before = path.read_bytes()
    for file in (tmp_path / "data0" / "blobs").glob("??/??/*"):
        file.unlink()
    with pytest.raises(CorruptDataError, match="its file is gone"):
        back_up(store, path)
    assert path.read_bytes() == before
    with pytest.raises(StoreUnavailableError, match="No such file or directory"):
        back_up(store, tmp_path / "nowhere" / "backup.tar")


def test_command_line(tmp_path, open_new):
    fill(store := open_new("sqlite"))
    file = str(tmp_path / "backup.tar")
    saved = CliRunner().invoke(application, ["backup", file, "--data", str(tmp_path / "data0")])
    loaded = CliRunner().invoke(application, ["restore", file, "--data", str(tmp_path / "other")])
    assert (saved.exit_code, loaded.exit_code) == (0, 0)
    assert json.loads(saved.stdout) == json.loads(loaded.stdout)
    other = Store.open(tmp_path / "other")
    assert digest_of(other) == digest_of(store)
    other.close()
    refused = CliRunner().invoke(application, ["restore", file, "--data", str(tmp_path / "other")])
    assert (refused.exit_code, "restore into an empty one" in refused.stderr) == (1, True)
