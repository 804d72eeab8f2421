"""What lists read of the database: no more with every prediction and task that there is."""

from contextlib import contextmanager

from sqlalchemy import event

from app.api.routes.tasks import list_tasks
from tests.services.conftest import scripted, store  # noqa: F401  # fixtures
from tests.services.test_upload_episode import upload


@contextmanager
def statements(opened):
    """The texts of the statements that are executed within."""
    texts, engine = [], opened._database.engine

    def noted(_connection, _cursor, statement, *_):
        texts.append(statement)

    event.listen(engine, "before_cursor_execute", noted)
    yield texts
    event.remove(engine, "before_cursor_execute", noted)


def test_a_list_of_tasks_reads_no_prediction(scripted):  # noqa: F811
    services = scripted("[]")
    services.upload_episode(upload("cube"))
    with statements(services.store) as texts:
        response = list_tasks(services)
    assert b'"num_episodes":1' in response.body
    assert not [text for text in texts if "predictions" in text]
