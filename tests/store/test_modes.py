"""What lies on disk is its user's alone."""

import os
import stat

import pytest

from app.services.api_keys import create_key
from app.store.backup import back_up
from app.store.errors import StoreUnavailableError
from app.store.store import Store
from tests.store.drafts import episode_draft, upload


@pytest.fixture
def careless():
    """What most shells say: others may read."""
    before = os.umask(0o022)
    yield
    os.umask(before)


def used(folder):
    """A store in which there is something of everything."""
    store = Store.open(folder)
    store.blobs.put(b"a picture")
    upload(store, episode_draft(1))
    create_key(store, "robot", "read")
    store.sweep_once()
    back_up(store, folder / "backup.tar")
    return store


def open_to_others(folder):
    found = [folder, *folder.rglob("*")]
    return {
        path.relative_to(folder).as_posix(): oct(path.stat().st_mode) for path in found if path.stat().st_mode & 0o077
    }


@pytest.mark.usefixtures("careless")
def test_nothing_that_is_written_is_readable_for_others(tmp_path):
    store = used(tmp_path / "data")
    names = {path.name for path in (tmp_path / "data").rglob("*")}
    assert {
        "roboprompt.db",
        "roboprompt.db-wal",
        "roboprompt.db-shm",
        "backup.tar",
        ".swept",
        ".lock",
    } <= names
    assert open_to_others(tmp_path / "data") == {}
    store.close()


@pytest.mark.usefixtures("careless")
def test_an_open_folder_is_closed_with_a_warning(tmp_path, caplog):
    used(tmp_path / "data").close()
    for path in (tmp_path / "data", *(tmp_path / "data").rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    Store.open(tmp_path / "data").close()
    assert open_to_others(tmp_path / "data") == {}
    assert "was open to others (mode 755)" in caplog.text


@pytest.mark.usefixtures("careless")
def test_a_folder_is_not_closed_twice(tmp_path, caplog):
    Store.open(tmp_path / "data").close()
    Store.open(tmp_path / "data").close()
    assert caplog.text == ""


@pytest.mark.usefixtures("careless")
@pytest.mark.parametrize("mode", [0o755, 0o1777])
def test_a_folder_that_is_visibly_something_else_is_left_alone(tmp_path, mode):
    """`--data /tmp` and `--data ~` must not lock others, or their owner's programs, out."""
    (tmp_path / "home/projects").mkdir(parents=True)
    (tmp_path / "home").chmod(mode)
    with pytest.raises(StoreUnavailableError, match="name a folder of its own"):
        Store.open(tmp_path / "home")
    assert stat.S_IMODE((tmp_path / "home").stat().st_mode) == mode
    assert [path.name for path in (tmp_path / "home").iterdir()] == ["projects"]


@pytest.mark.usefixtures("careless")
def test_another_users_folder_is_refused(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    owner = (tmp_path / "data").stat().st_uid
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(StoreUnavailableError, match=f"belongs to user {owner}"):
        Store.open(tmp_path / "data")


@pytest.mark.usefixtures("careless")
def test_links_are_not_followed_when_a_folder_is_closed(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "outside").write_text("x")
    (tmp_path / "outside").chmod(0o644)
    (tmp_path / "data/link").symlink_to(tmp_path / "outside")
    Store.open(tmp_path / "data").close()
    assert stat.S_IMODE((tmp_path / "outside").stat().st_mode) == 0o644
