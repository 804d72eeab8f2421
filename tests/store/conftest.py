import hashlib

import pytest

from app.store.store import Store
from tests.s3 import BUCKET
from tests.stores import opened


@pytest.fixture(params=["sqlite", "postgres"])
def database_url(request, tmp_path):
    """Of a new database on either server, without tables on SQLite."""
    if request.param == "sqlite":
        (tmp_path / "data").mkdir()
        return f"sqlite:///{tmp_path / 'data' / 'roboprompt.db'}"
    return request.getfixturevalue("postgres").migrated()


@pytest.fixture
def store(tmp_path, database_url, migrated_database):
    folder = tmp_path / "data"
    store = opened(folder, migrated_database) if database_url.startswith("sqlite") else Store.open(folder, database_url)
    yield store
    store.close()


@pytest.fixture
def sqlite_store(tmp_path, migrated_database):
    store = opened(tmp_path / "data", migrated_database)
    yield store
    store.close()


@pytest.fixture
def s3_url(s3_environment, monkeypatch, request):
    for name, value in s3_environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{BUCKET}/{hashlib.sha256(request.node.name.encode()).hexdigest()[:8]}"
