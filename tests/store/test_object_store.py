import hashlib
import tarfile
from datetime import timedelta

import httpx
import obstore
import pytest

from app.store.backup import back_up
from app.store.blobs import digest_path
from app.store.errors import CorruptDataError, StoreUnavailableError
from app.store.object_store import ObjectBlobStore
from app.store.store import Store
from tests.e2e.processes import running_server
from tests.reliability.service import ENVIRONMENT, image_of, upload_files

AT_ONCE = timedelta(0)


@pytest.fixture
def blobs(s3_url):
    return ObjectBlobStore(s3_url)


def path_of(digest):
    return f"{digest[:2]}/{digest[2:4]}/{digest}"


def test_prefixes_are_apart(s3_url, blobs):
    other = ObjectBlobStore(f"{s3_url}-other")
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


@pytest.mark.usefixtures("s3_environment")
def test_server_that_is_not_there(monkeypatch, s3_url):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    blobs = ObjectBlobStore(s3_url)
    for use in (lambda: blobs.put(b"image"), lambda: blobs.read("0" * 64), lambda: blobs.sweep(set(), AT_ONCE)):
        with pytest.raises(StoreUnavailableError, match="object store"):
            use()


@pytest.mark.parametrize("wrong", ["s4://bucket", "nonsense"])
def test_other_urls_are_refused(tmp_path, wrong):
    with pytest.raises(StoreUnavailableError, match="object store"):
        Store.open(tmp_path, blobs_url=wrong)


def test_service_and_backup_with_images_in_s3(tmp_path, s3_url, s3_environment):
    environment = {**ENVIRONMENT, **s3_environment, "ROBOPROMPT_BLOBS_URL": s3_url}
    with running_server(tmp_path / "data", environment) as service:
        added = httpx.post(f"{service}/episodes", files=upload_files(1)).json()
        image = httpx.get(f"{service}/episodes/{added['id']}/images/front/rgb")
        assert image.content == image_of(1)
    assert not (tmp_path / "data" / "blobs").exists()
    store = Store.open(tmp_path / "data", blobs_url=s3_url)
    assert back_up(store, tmp_path / "backup.tar") == 1
    store.close()
    digest = hashlib.sha256(image_of(1)).hexdigest()
    with tarfile.open(tmp_path / "backup.tar") as archive:
        assert archive.extractfile(f"blobs/{digest_path(digest)}").read() == image_of(1)
