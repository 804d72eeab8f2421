from dataclasses import replace

import pytest

from app.store import predictions
from app.store.errors import NotFoundError
from app.store.filters import PredictionFilter

from .drafts import TASK, camera_record, object_record, predict, prediction_draft, read, write

SEEN = {
    "objects": (replace(object_record("drawer"), confidence=0.75, reason="partly hidden"), object_record("cube", 1)),
    "cameras": (camera_record(rgb_digest="ab"),),
}
FAILED = {"status": "model_error", "reply_text": None, "actions": None, "error": "no answer within 60 s"}


@pytest.mark.parametrize("changes", [{}, SEEN, FAILED, {"actions": ()}], ids=["plain", "seen", "failed", "no rows"])
def test_everything_comes_back(store, changes):
    draft = prediction_draft(**changes)
    added = predict(store, draft)
    stored = read(store, predictions.get, added.id)
    assert stored == added
    assert {name: getattr(stored, name) for name in vars(draft)} == vars(draft)
    assert (stored.outcome_success, stored.outcome_note, stored.outcome_at) == (None, None, None)


def test_outcome_can_be_corrected(store):
    added = predict(store, prediction_draft())
    first = write(store, predictions.record_outcome, added.id, True, "opened")
    with store.write() as connection:
        second = predictions.record_outcome(connection, added.id, False, None)
        assert predictions.get(connection, added.id) == second
    assert (first.outcome_success, first.outcome_note) == (True, "opened")
    assert (second.outcome_success, second.outcome_note) == (False, None)
    assert added.created_at <= first.outcome_at <= second.outcome_at
    assert first.prompt_user == added.prompt_user


def test_unknown_prediction(store):
    with store.write() as connection:
        with pytest.raises(NotFoundError, match="there is no prediction 'nope'"):
            predictions.get(connection, "nope")
        with pytest.raises(NotFoundError, match="there is no prediction 'nope'"):
            predictions.record_outcome(connection, "nope", True, None)


def test_pages_by_task_and_outcome(store):
    ids = [predict(store, prediction_draft(task=(TASK, "other")[number % 2])).id for number in range(6)]
    with store.write() as connection:
        predictions.record_outcome(connection, ids[0], True, None)
        predictions.record_outcome(connection, ids[1], True, None)
        predictions.record_outcome(connection, ids[2], False, None)

        def listed(**chosen):
            return [record.id for record in predictions.list_page(connection, PredictionFilter(**chosen)).items]

        assert listed() == ids[::-1]
        assert listed(task=TASK) == [ids[4], ids[2], ids[0]]
        assert listed(outcome="success") == [ids[1], ids[0]]
        assert listed(task=TASK, outcome="success") == [ids[0]]
        assert listed(outcome="failure") == [ids[2]]
        assert listed(outcome="unknown") == [ids[5], ids[4], ids[3]]
        page = predictions.list_page(connection, PredictionFilter(outcome="unknown"), limit=2)
        assert [record.id for record in page.items] == [ids[5], ids[4]]
        rest = predictions.list_page(connection, PredictionFilter(outcome="unknown"), limit=2, cursor=page.next_cursor)
        assert ([record.id for record in rest.items], rest.next_cursor) == ([ids[3]], None)
