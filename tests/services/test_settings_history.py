"""Changes of a task's settings are kept, and can be undone."""

import pytest

from app.services.teach.history import settings_history
from app.store import erasure, replaced_settings, tasks
from app.store.errors import NotFoundError
from app.store.visibility import Visibility, seeing
from tests.services.conftest import scripted, store  # noqa: F401  # fixtures
from tests.services.test_upload_episode import upload


@pytest.fixture
def services(scripted):  # noqa: F811
    return scripted("[]")


def history(services, name="pick"):
    with services.store.read() as connection:
        return settings_history(connection, name)


def test_a_change_is_kept_with_its_author_and_what_undoes_it(services):
    services.configure_task("pick", {})
    assert history(services) == []
    with seeing(Visibility(actor="ann (1234)")):
        services.configure_task("pick", {"num_demonstrations": 3, "robot_base": (0, 0, 0.5)})
    services.configure_task("pick", {"num_demonstrations": 5})
    newest, oldest = history(services)
    assert (newest.replaced.replaced_by, oldest.replaced.replaced_by) == ("local", "ann (1234)")
    assert newest.changed == {"num_demonstrations": (3, 5)}
    assert newest.restore == {"num_demonstrations": 3}
    assert oldest.restore == {"num_demonstrations": 10, "robot_base": [0.0, 0.0, 0.0]}
    assert (oldest.replaced.version, newest.replaced.version) == (1, 2)
    services.configure_task("pick", oldest.restore)
    undone, *_, first = history(services)
    assert undone.restore == {"num_demonstrations": 5, "robot_base": [0.0, 0.0, 0.5]}
    assert first.restore == {}


def test_what_follows_from_episodes_is_no_change_of_settings(services):
    services.upload_episode(upload("cube"))
    assert history(services) == []
    box = {"min": (-1.0, -1.0, 0.0), "max": (1.0, 1.0, 2.0)}
    services.configure_task("pick", {"workspace": box})
    (change,) = history(services)
    assert (list(change.changed), change.restore["workspace"]["preset"]) == (["workspace"], "auto")
    services.configure_task("pick", change.restore)
    assert history(services)[0].changed["workspace"][1]["preset"] == "auto"
    assert history(services)[1].restore == {}


def test_only_the_newest_are_kept_and_they_go_with_the_task(services, monkeypatch):
    monkeypatch.setattr(replaced_settings, "MAX_KEPT", 3)
    for number in range(1, 7):
        services.configure_task("pick", {"num_demonstrations": number})
    assert [change.changed["num_demonstrations"] for change in history(services)] == [(5, 6), (4, 5), (3, 4)]
    with services.store.write() as connection:
        erasure.erase_task(connection, "pick")
    with pytest.raises(NotFoundError):
        history(services)
    services.configure_task("pick", {})
    assert history(services) == []
    with services.store.read() as connection:
        assert tasks.get(connection, "pick").version == 1
