import hashlib

import pytest

from app.store.store import Store
from tests.s3 import BUCKET


@pytest.fixture(params=["sqlite", "postgres"])
def database_url(request, tmp_path):
    """Of a new database on either server, without tables on SQLite."""
    if request.param == "sqlite":
        (tmp_path / "data").mkdir()
        return f"sqlite:///{tmp_path / 'data' / 'roboprompt.db'}"
    return request.getfixturevalue("postgres").migrated()


@pytest.fixture
def store(tmp_path, database_url):
    opened = Store.open(tmp_path / "data", database_url)
    yield opened
    opened.close()


@pytest.fixture
def sqlite_store(tmp_path):
    opened = Store.open(tmp_path / "data")
    yield opened
    opened.close()


@pytest.fixture
def s3_url(s3_environment, monkeypatch, request):
    for name, value in s3_environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{BUCKET}/{hashlib.sha256(request.node.name.encode()).hexdigest()[:8]}"
