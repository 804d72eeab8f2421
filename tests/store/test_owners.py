"""What belongs to which key, and what to none, in each query."""

import pytest

from app.store import idempotency, predictions
from app.store.errors import NotFoundError
from app.store.visibility import Visibility, seeing

from .drafts import predict, prediction_draft, write

ROBOT, RIVAL = (Visibility(key, reads=False, judges_others=False) for key in ("robot", "rival"))


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
