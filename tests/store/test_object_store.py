import hashlib
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import httpx
import obstore
import pytest

from app.store.backup import back_up, restore
from app.store.errors import CorruptDataError, StoreUnavailableError
from app.store.object_store import ObjectBlobStore
from app.store.store import Store
from tests.e2e.processes import running_server
from tests.reliability.service import ENVIRONMENT, image_of, upload_files
from tests.s3 import BUCKET

AT_ONCE = timedelta(0)
HOUR = timedelta(hours=1)


@pytest.fixture
def url(s3_environment, monkeypatch, request):
    for name, value in s3_environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{BUCKET}/{hashlib.sha256(request.node.name.encode()).hexdigest()[:8]}"


@pytest.fixture
def blobs(url):
    return ObjectBlobStore(url)


def path_of(digest):
    return f"{digest[:2]}/{digest[2:4]}/{digest}"


@pytest.mark.parametrize("data", [b"", b"x", bytes(range(256)) * 1000])
def test_bytes_come_back_under_their_sha256(blobs, data):
    digest = blobs.put(data)
    assert digest == hashlib.sha256(data).hexdigest()
    assert blobs.put(data) == digest
    assert blobs.read(digest) == data


def test_sweep_removes_what_nobody_refers_to(blobs):
    kept, orphan = blobs.put(b"kept"), blobs.put(b"orphan")
    assert blobs.sweep({kept}, HOUR) == 0
    assert blobs.sweep({kept}, AT_ONCE) == 1
    assert blobs.read(kept) == b"kept"
    with pytest.raises(CorruptDataError, match="its object is gone"):
        blobs.read(orphan)


def test_prefixes_are_apart(url, blobs):
    other = ObjectBlobStore(f"{url}-other")
    digest = other.put(b"of somebody else")
    assert blobs.sweep(set(), AT_ONCE) == 0
    assert other.read(digest)


def test_an_old_object_is_written_again(blobs, monkeypatch):
    digest = blobs.put(b"image")
    before = obstore.head(blobs._store, path_of(digest))["e_tag"]
    obstore.put(blobs._store, path_of(digest), b"imaga")
    blobs.put(b"image")  # trusted: it is young
    assert obstore.head(blobs._store, path_of(digest))["e_tag"] != before
    monkeypatch.setattr("app.store.object_store.TRUSTED_AGE", AT_ONCE)
    blobs.put(b"image")
    assert obstore.head(blobs._store, path_of(digest))["e_tag"] == before


def test_damaged_object_is_noticed(blobs):
    digest = blobs.put(b"image")
    obstore.put(blobs._store, path_of(digest), b"imaga")
    with pytest.raises(CorruptDataError, match="do not match"):
        blobs.read(digest)


@pytest.mark.parametrize("digest", ["", "../../etc/passwd", "A" * 64])
def test_only_digests_lead_to_objects(blobs, digest):
    with pytest.raises(CorruptDataError, match="not a SHA-256"):
        blobs.read(digest)


def test_many_threads(blobs):
    with ThreadPoolExecutor(8) as pool:
        digests = set(pool.map(lambda k: blobs.put(bytes([k % 3])), range(24)))
        assert sorted(pool.map(blobs.read, digests)) == [b"\0", b"\1", b"\2"]


@pytest.mark.usefixtures("s3_environment")
def test_server_that_is_not_there(monkeypatch, url):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    blobs = ObjectBlobStore(url)
    for use in (lambda: blobs.put(b"image"), lambda: blobs.read("0" * 64), lambda: blobs.sweep(set(), AT_ONCE)):
        with pytest.raises(StoreUnavailableError, match="object store"):
            use()


@pytest.mark.parametrize("wrong", ["s4://bucket", "nonsense"])
def test_other_urls_are_refused(tmp_path, wrong):
    with pytest.raises(StoreUnavailableError, match="object store"):
        Store.open(tmp_path, blobs_url=wrong)


def test_service_and_backup_with_images_in_s3(tmp_path, url, s3_environment):
    environment = {**ENVIRONMENT, **s3_environment, "ROBOPROMPT_BLOBS_URL": url}
    with running_server(tmp_path / "data", environment) as service:
        added = httpx.post(f"{service}/episodes", files=upload_files(1)).json()
        image = httpx.get(f"{service}/episodes/{added['id']}/images/front/rgb")
        assert image.content == image_of(1)
    assert not (tmp_path / "data" / "blobs").exists()
    store, folder = Store.open(tmp_path / "data", blobs_url=url), Store.open(tmp_path / "restored")
    back_up(store, tmp_path / "backup.tar")
    assert restore(folder, tmp_path / "backup.tar").num_blobs == 1
    assert folder.blobs.read(hashlib.sha256(image_of(1)).hexdigest()) == image_of(1)
    store.close()
    folder.close()
