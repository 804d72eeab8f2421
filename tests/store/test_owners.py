"""What belongs to which key, and what to none, in each query."""

import pytest
from sqlalchemy import text

from app.services.api_keys import caller_from
from app.store import idempotency, predictions
from app.store.api_keys import ApiKeyRecord
from app.store.errors import ForbiddenTaskError, NotFoundError
from app.store.visibility import Visibility, seeing

from .drafts import TASK, predict, prediction_draft, write

ROBOT, RIVAL = (Visibility(key, others=False, demonstrations=False, judges_others=False) for key in ("robot", "rival"))


def test_what_was_sent_without_a_key_has_no_owner(store):
    asked = predict(store, prediction_draft())
    write(store, idempotency.save, idempotency.UPLOAD, "k", "d", {"id": "e"})
    with seeing(ROBOT), store.read() as connection:
        with pytest.raises(NotFoundError):
            predictions.get(connection, asked.id)
        assert idempotency.find(connection, idempotency.UPLOAD, "k", "d") == {"id": "e"}
        assert idempotency.find(connection, idempotency.UPLOAD, "k", "other content") is None


def test_answers_belong_to_who_got_them(store):
    for visibility, id_ in ((ROBOT, "1"), (RIVAL, "2"), (Visibility(), "3")):
        with seeing(visibility), store.write() as connection:
            assert idempotency.find(connection, idempotency.PREDICT, "k", "d") is None
            idempotency.save(connection, idempotency.PREDICT, "k", "d", {"id": id_})
    with seeing(RIVAL), store.write() as connection:
        assert idempotency.answered(connection, idempotency.PREDICT, "k") == {"id": "2"}
        idempotency.save(connection, idempotency.PREDICT, "k", "d", {"id": "4"})
    with seeing(ROBOT), store.read() as connection:
        assert idempotency.find(connection, idempotency.PREDICT, "k", "d") == {"id": "1"}
    with seeing(RIVAL), store.read() as connection:
        assert idempotency.find(connection, idempotency.PREDICT, "k", "d") == {"id": "4"}


def test_predictions_belong_to_who_asked(store):
    with seeing(ROBOT):
        asked = predict(store, prediction_draft())
    assert asked.key_id == "robot"
    with store.read() as connection:
        for visibility, seen in ((ROBOT, 1), (RIVAL, 0), (Visibility(), 1), (Visibility(tasks=(TASK,)), 1)):
            with seeing(visibility):
                assert len(predictions.list_page(connection).items) == seen
        with seeing(Visibility(tasks=("other",))):
            assert predictions.list_page(connection).items == ()
            with pytest.raises(ForbiddenTaskError, match=f"not for the task '{TASK}', only for 'other'"):
                predictions.list_page(connection, TASK)


@pytest.mark.parametrize(
    ("scopes", "others", "demonstrations", "judges_others"),
    [
        (("predict",), False, False, False),
        (("upload", "predict"), False, False, False),
        (("read",), True, True, False),
        (("read", "predict"), True, True, False),
        (("admin",), True, True, True),
    ],
)
def test_what_scopes_let_see(store, scopes, others, demonstrations, judges_others):
    with store.read() as connection:
        (now,) = connection.execute(text("SELECT CURRENT_TIMESTAMP")).one()
    caller = caller_from(ApiKeyRecord("k", "name", "d", scopes, now, tasks=("pick",)))
    assert caller.visibility == Visibility("k", ("pick",), others, demonstrations, judges_others)
