import fcntl
import hashlib
import os
import resource
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path

import pytest

from app.store.blobs import FileBlobStore
from app.store.errors import CorruptDataError, StoreUnavailableError
from app.store.object_store import ObjectBlobStore

HOUR = timedelta(hours=1)
AT_ONCE = timedelta(0)


@pytest.fixture
def blobs(tmp_path):
    return FileBlobStore(tmp_path / "blobs")


def file_of(tmp_path, digest):
    return tmp_path / "blobs" / digest[:2] / digest[2:4] / digest


def age(path, hours):
    then = time.time() - hours * 3600
    os.utime(path, (then, then))


@pytest.fixture(params=["file", "s3"])
def either(request, tmp_path):
    """A BlobStore of each kind."""
    return FileBlobStore(tmp_path) if request.param == "file" else ObjectBlobStore(request.getfixturevalue("s3_url"))


@pytest.mark.parametrize("data", [b"", b"x", bytes(range(256)) * 1000])
def test_bytes_come_back_under_their_sha256(either, data):
    digest = either.put(data)
    assert digest == hashlib.sha256(data).hexdigest() == either.put(data)
    assert either.read(digest) == data


def test_the_sweep_removes_unreferenced_blobs(either):
    kept, orphan = either.put(b"kept"), either.put(b"orphan")
    assert either.sweep({kept}, HOUR) == 0
    assert either.sweep({kept}, AT_ONCE) == 1
    assert either.read(kept) == b"kept"
    with pytest.raises(CorruptDataError, match="is gone"):
        either.read(orphan)


@pytest.mark.parametrize("digest", ["", "../../etc/passwd", "A" * 64, "0" * 63])
def test_only_digests_lead_to_blobs(either, digest):
    with pytest.raises(CorruptDataError, match="not a SHA-256"):
        either.read(digest)


def test_many_threads_put_the_same_bytes(either):
    with ThreadPoolExecutor(8) as pool:
        digests = set(pool.map(lambda k: either.put(bytes([k % 3])), range(24)))
        assert sorted(pool.map(either.read, digests)) == [b"\0", b"\1", b"\2"]
    assert either.sweep(digests, AT_ONCE) == 0


def test_what_is_there_is_not_written_again(blobs, tmp_path):
    digest = blobs.put(b"image")
    inode = file_of(tmp_path, digest).stat().st_ino
    assert blobs.put(b"image") == digest
    assert file_of(tmp_path, digest).stat().st_ino == inode
    assert [path.name for path in file_of(tmp_path, digest).parent.iterdir()] == [digest]


def test_file_is_synced_before_it_gets_its_name_and_every_folder_after(blobs, tmp_path, monkeypatch):
    events = []
    sync, rename = os.fsync, Path.replace

    def observed_sync(descriptor):
        events.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        sync(descriptor)

    def observed_rename(self, target):
        events.append(f"rename to {target}")
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", observed_sync)
    monkeypatch.setattr(Path, "replace", observed_rename)
    path = file_of(tmp_path, blobs.put(b"image"))
    assert events[0].startswith(f"{path.parent}/.tmp-")
    assert events[1:] == [f"rename to {path}", str(path.parent), str(path.parent.parent), str(tmp_path / "blobs")]


def test_sweep_spares_uploads_under_way(blobs, tmp_path):
    digest = blobs.put(b"its row is not committed yet")
    temporary = file_of(tmp_path, digest).with_name(".tmp-under-way")
    temporary.write_bytes(b"half")
    assert blobs.sweep(set(), HOUR) == 0
    assert temporary.exists()
    assert blobs.read(digest)


def test_sweep_removes_unfinished_writes(blobs, tmp_path):
    digest = blobs.put(b"kept")
    temporary = file_of(tmp_path, digest).with_name(".tmp-of-a-crash")
    temporary.write_bytes(b"half")
    age(temporary, hours=2)
    assert blobs.sweep({digest}, HOUR) == 1
    assert not temporary.exists()


def test_putting_an_old_orphan_again_saves_it_from_the_sweep(blobs, tmp_path):
    digest = blobs.put(b"image")
    age(file_of(tmp_path, digest), hours=2)
    blobs.put(b"image")
    assert blobs.sweep(set(), HOUR) == 0
    assert blobs.read(digest) == b"image"


def test_sweep_waits_for_a_put_that_is_about_to_renew(blobs, tmp_path):
    path = file_of(tmp_path, blobs.put(b"image"))
    age(path, hours=2)
    with (tmp_path / "blobs" / ".lock").open("rb") as lock, ThreadPoolExecutor(1) as pool:
        fcntl.flock(lock, fcntl.LOCK_SH)
        sweep = pool.submit(blobs.sweep, set(), HOUR)
        time.sleep(0.1)
        os.utime(path)
        fcntl.flock(lock, fcntl.LOCK_UN)
        assert sweep.result() == 0
    assert path.exists()


def test_put_and_sweep_at_the_same_time(blobs, tmp_path):
    path = file_of(tmp_path, blobs.put(b"image"))
    with ThreadPoolExecutor(2) as pool:
        for _ in range(50):
            age(path, hours=2)
            sweep, put = pool.submit(blobs.sweep, set(), HOUR), pool.submit(blobs.put, b"image")
            sweep.result()
            assert blobs.read(put.result()) == b"image"


def test_damaged_file_is_noticed(blobs, tmp_path):
    digest = blobs.put(b"image")
    file_of(tmp_path, digest).write_bytes(b"imaga")
    with pytest.raises(CorruptDataError, match=f"blob {digest} is damaged: its bytes do not match"):
        blobs.read(digest)


def test_full_disk_leaves_nothing_behind(blobs, tmp_path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(StoreUnavailableError, match="blob storage"):
            blobs.put(bytes(5000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path for path in tmp_path.rglob("*") if path.is_file() and path.name != ".lock"] == []


def test_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreUnavailableError, match="file"):
        FileBlobStore(tmp_path / "file" / "blobs")
