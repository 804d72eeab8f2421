"""Backups that somebody else has written: links, headers that lie, planted keys, rows and programs."""

import hashlib
import io
import sqlite3
import tarfile
import time

import pytest
from typer.testing import CliRunner

from app.cli import application
from app.services.api_keys import create_key
from app.store import api_keys
from app.store.backup import back_up, restore
from app.store.errors import ConflictError, CorruptDataError
from app.store.store import Store
from tests.store.drafts import episode_draft, upload


@pytest.fixture
def backup(tmp_path):
    """Of a service with one key that was revoked since, and one that is valid."""
    store = Store.open(tmp_path / "old")
    upload(store, episode_draft(1))
    create_key(store, "revoked", ["admin"])
    create_key(store, "valid", ["read"])
    back_up(store, tmp_path / "backup.tar")
    store.close()
    return tmp_path / "backup.tar"


@pytest.fixture
def new(tmp_path):
    store = Store.open(tmp_path / "new")
    yield store
    store.close()


def key_names(store):
    with store.read() as connection:
        return [record.name for record in api_keys.list_all(connection)]


def member(name, kind=tarfile.REGTYPE, **attributes):
    item = tarfile.TarInfo(name)
    item.type = kind
    for attribute, value in attributes.items():
        setattr(item, attribute, value)
    return item


def of_members(path, *members, data=b""):
    with tarfile.open(path, "w:") as archive:
        for item in members:
            archive.addfile(item, io.BytesIO(data) if item.isreg() and item.size else None)
    return path


LINKS = {
    "to a file that is not there": member("blobs/a", tarfile.SYMTYPE, linkname="nothing"),
    "to a file of the machine": member("roboprompt.db", tarfile.SYMTYPE, linkname="/etc/passwd"),
    "hard, to itself": member("roboprompt.db", tarfile.LNKTYPE, linkname="roboprompt.db"),
    "device": member("roboprompt.db", tarfile.CHRTYPE, devmajor=1, devminor=5),
    "pipe": member("roboprompt.db", tarfile.FIFOTYPE),
    "folder": member("blobs/", tarfile.DIRTYPE),
}


@pytest.mark.parametrize("kind", LINKS)
def test_members_that_are_no_files(tmp_path, new, kind):
    with pytest.raises(CorruptDataError, match="is no plain file"):
        restore(new, of_members(tmp_path / "bad.tar", LINKS[kind]))


def test_a_file_with_holes_is_not_filled_with_zeros(tmp_path, new):
    """A kilobyte that says it is a terabyte."""
    holes = {"GNU.sparse.size": str(1 << 40), "GNU.sparse.map": "0,0", "GNU.sparse.name": "blobs/a"}
    sparse = member("blobs/a", pax_headers=holes)
    with pytest.raises(CorruptDataError, match="is no plain file"):
        restore(new, of_members(tmp_path / "bad.tar", sparse))


@pytest.mark.parametrize("size", ["-1536", "-512", "-1", "x", "9" * 30])
def test_invalid_sizes_end_the_restore(tmp_path, new, size):
    """With a negative size some versions of tarfile read the same headers for ever (CVE-2025-8194)."""
    empty = hashlib.sha256(b"").hexdigest()
    path = of_members(tmp_path / "bad.tar", member(f"blobs/{empty}", pax_headers={"size": size}))
    begun_s = time.monotonic()
    with pytest.raises(CorruptDataError):
        restore(new, path)
    assert time.monotonic() - begun_s < 10


def test_the_command_refuses_in_one_sentence(tmp_path):
    path = of_members(tmp_path / "bad.tar", LINKS["to a file that is not there"])
    done = CliRunner().invoke(application, ["restore", str(path), "--data", str(tmp_path / "data")])
    assert (done.exit_code, type(done.exception)) == (1, SystemExit)
    assert "'blobs/a' is no plain file" in done.stderr


def rewritten(backup, *statements):
    """The backup with a database in which somebody ran these."""
    with tarfile.open(backup) as archive:
        members = {item.name: archive.extractfile(item).read() for item in archive}
    database = backup.with_name("changed.db")
    database.write_bytes(members["roboprompt.db"])
    with sqlite3.connect(database) as connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()
    members["roboprompt.db"] = database.read_bytes()
    with tarfile.open(backup, "w:") as archive:
        for name, data in members.items():
            archive.addfile(member(name, size=len(data)), io.BytesIO(data))
    return backup


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE TRIGGER t AFTER UPDATE ON tasks BEGIN DELETE FROM episodes; END",
        "CREATE VIEW v AS SELECT * FROM tasks",
        "CREATE VIRTUAL TABLE f USING fts5(a)",
    ],
)
def test_a_database_that_runs_something(backup, new, statement):
    with pytest.raises(CorruptDataError, match=r"it has the (trigger|view|table)"):
        restore(new, rewritten(backup, statement))


@pytest.mark.parametrize(
    "statement",
    ["UPDATE tasks SET settings = '{'", "UPDATE episodes SET task = 'none'", "UPDATE episodes SET created_at = 'x'"],
)
def test_rows_that_no_service_writes_restore_nothing(backup, new, statement):
    with pytest.raises(CorruptDataError):
        restore(new, rewritten(backup, statement))


def test_keys_are_restored_only_on_request(backup, new):
    create_key(new, "mine", ["admin"])
    restore(new, backup)
    assert key_names(new) == ["mine"]


def test_restored_keys_are_named_in_the_log(backup, new):
    restore(new, backup, with_keys=True)
    assert key_names(new) == ["revoked", "valid"]


def test_keys_are_not_restored_into_a_store_with_keys(backup, new):
    create_key(new, "mine", ["admin"])
    with pytest.raises(ConflictError, match="api_keys"):
        restore(new, backup, with_keys=True)
