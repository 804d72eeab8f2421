"""Blobs in an object store such as S3: `prefix/ab/cd/abcd...`, as in the folder of `FileBlobStore`.

Sweeping: between the last look at an object and its deletion lie milliseconds in which a request may put the same bytes
again. Where that matters switch the bucket's versioning on: deletions can then be undone.
"""

import hashlib
from collections.abc import Iterator, Set
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

import obstore
from obstore.exceptions import BaseError, NotFoundError, UnknownConfigurationKeyError
from obstore.store import ObjectStore, from_url

from app.store.blobs import digest_path
from app.store.errors import CorruptDataError, StoreUnavailableError, unavailable

TIMEOUT_S = 20
RETRIES = 2
# An older one counts as put just now only if it is written again, so that no sweep takes it before the commit.
TRUSTED_AGE = timedelta(minutes=20)
_FAILURES = (BaseError, UnknownConfigurationKeyError, OSError, ValueError)


class ObjectBlobStore:
    """A BlobStore in a bucket; raises StoreUnavailableError if obstore does not know the URL.

    Args:
        url: ``s3://bucket/prefix``; address and keys come from AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID and so on.
    """

    def __init__(self, url: str) -> None:
        try:
            self._store: ObjectStore = from_url(
                url,
                # who names an endpoint of http:// means it
                client_options={"timeout": f"{TIMEOUT_S}s", "connect_timeout": "5s", "allow_http": True},
                retry_config={"max_retries": RETRIES, "retry_timeout": timedelta(seconds=TIMEOUT_S)},
            )
        except _FAILURES as error:
            raise StoreUnavailableError(f"object store: {str(error).splitlines()[0]}") from error

    def put(self, data: bytes) -> str:
        digest = hashlib.sha256(data).hexdigest()
        path = digest_path(digest)
        with _errors():
            age = self._age(path)
            if age is None or age >= TRUSTED_AGE:
                obstore.put(self._store, path, data)
        return digest

    def read(self, digest: str) -> bytes:
        with _errors():
            try:
                data = bytes(obstore.get(self._store, digest_path(digest)).bytes())
            except (NotFoundError, FileNotFoundError) as error:
                raise CorruptDataError("blob", digest, "its object is gone") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise CorruptDataError("blob", digest, "its bytes do not match the digest")
        return data

    def sweep(self, referenced: Set[str], older_than: timedelta) -> int:
        limit, removed = datetime.now(UTC) - older_than, 0
        with _errors():
            for chunk in obstore.list(self._store):
                for item in chunk:
                    if item["path"].rpartition("/")[2] not in referenced:
                        removed += self._remove_if_older(item["path"], limit)
        return removed

    def _age(self, path: str) -> timedelta | None:
        try:
            return datetime.now(UTC) - obstore.head(self._store, path)["last_modified"]
        except (NotFoundError, FileNotFoundError):
            return None

    def _remove_if_older(self, path: str, limit: datetime) -> bool:
        age = self._age(path)
        if age is None or datetime.now(UTC) - age >= limit:
            return False
        obstore.delete(self._store, path)
        return True


@contextmanager
def _errors() -> Iterator[None]:
    try:
        yield
    except _FAILURES as error:
        raise unavailable(
            "object store", f"{type(error).__name__}, see the service's log", str(error).splitlines()[0]
        ) from error
