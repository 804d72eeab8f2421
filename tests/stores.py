"""Stores whose database is a copy: its tables are made once in a run of tests, which takes ten times as long."""

from shutil import copyfile

import pytest

from app.store.store import Store


@pytest.fixture(scope="session")
def migrated_database(tmp_path_factory):
    """The file of a database of SQLite with all tables and no rows."""
    folder = tmp_path_factory.mktemp("migrated")
    Store.open(folder / "data").close()
    return folder / "data" / "roboprompt.db"


def opened(data_dir, migrated_database):
    """The store of a new data directory."""
    data_dir.mkdir(mode=0o700, exist_ok=True)
    copyfile(migrated_database, data_dir / migrated_database.name)
    return Store.open(data_dir)
