import hashlib
import tarfile

import pytest
from sqlalchemy import select
from typer.testing import CliRunner

from app.cli import application
from app.store import episodes, predictions
from app.store.backup import back_up
from app.store.errors import CorruptDataError, StoreUnavailableError
from app.store.store import Store, blob_digests
from app.store.tables import metadata

from .drafts import camera_record, episode_draft, predict, prediction_draft, read, upload


def fill(store):
    for seed in range(3):
        digest = store.blobs.put(f"image {seed}".encode())
        upload(store, episode_draft(seed, cameras=(camera_record(rgb_digest=digest),)))
    seen = store.blobs.put(b"seen")
    added = predict(store, prediction_draft(cameras=(camera_record(rgb_digest=seen),)))
    with store.write() as connection:
        predictions.record_outcome(connection, added.id, True, "Zoë \N{ROBOT FACE}")
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
def store(tmp_path):
    opened = Store.open(tmp_path / "data")
    fill(opened)
    yield opened
    opened.close()


def unpacked(path, folder):
    """The store of a backup, unpacked as docs say."""
    with tarfile.open(path) as archive:
        archive.extractall(folder, filter="data")
    return Store.open(folder)


def test_an_unpacked_backup_is_the_data_folder(tmp_path, store):
    assert back_up(store, tmp_path / "backup.tar") == 4
    restored = unpacked(tmp_path / "backup.tar", tmp_path / "restored")
    assert digest_of(restored) == digest_of(store)
    assert upload(restored, episode_draft(9)).sequence == 4
    restored.close()
    assert {path.name for path in tmp_path.iterdir()} == {"backup.tar", "data", "restored"}


def test_backup_is_of_one_moment(tmp_path, store, monkeypatch):
    read_blob = store.blobs.read

    def read_while_others_upload(digest):
        upload(store, episode_draft(7))
        return read_blob(digest)

    monkeypatch.setattr(store.blobs, "read", read_while_others_upload)
    back_up(store, tmp_path / "backup.tar")
    restored = unpacked(tmp_path / "backup.tar", tmp_path / "restored")
    assert len(read(restored, episodes.list_page).items) == 3
    restored.close()


def test_backup_that_cannot_be_written_leaves_the_last_one(tmp_path, store):
    path = tmp_path / "backup.tar"
    back_up(store, path)
    before = path.read_bytes()
    for file in (tmp_path / "data" / "blobs").glob("??/??/*"):
        file.unlink()
    with pytest.raises(CorruptDataError, match="its file is gone"):
        back_up(store, path)
    assert path.read_bytes() == before
    with pytest.raises(StoreUnavailableError, match="No such file or directory"):
        back_up(store, tmp_path / "nowhere" / "backup.tar")


def test_postgresql_is_referred_to_its_own_tool(tmp_path, postgres):
    store = Store.open(tmp_path / "data", postgres.migrated())
    with pytest.raises(StoreUnavailableError, match="pg_dump"):
        back_up(store, tmp_path / "backup.tar")
    store.close()
    assert not (tmp_path / "backup.tar").exists()


def test_command_line(tmp_path, store):
    arguments = ["backup", str(tmp_path / "backup.tar"), "--data", str(tmp_path / "data")]
    saved = CliRunner().invoke(application, arguments)
    assert (saved.exit_code, saved.stdout) == (0, f"{tmp_path / 'backup.tar'}: the database and 4 images\n")
