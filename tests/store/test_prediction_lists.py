import pytest

from app.store import prediction_lists, predictions
from app.store.filters import FATES, PredictionFilter
from app.store.prediction_lists import Counts

from .drafts import TASK, predict, prediction_draft, read, write

REFUSED = {"status": "parse_error", "actions": None, "error": "the reply has 0 lists of actions"}


@pytest.fixture
def mixed(store):
    """Three predictions of every fate, mixed in time; by fate, newest first."""
    ids = {fate: [] for fate in FATES}
    for _ in range(3):
        for fate in ("success", "unknown", "refused", "failure"):
            added = predict(store, prediction_draft(**(REFUSED if fate == "refused" else {})))
            ids[fate].insert(0, added.id)
            if fate in ("success", "failure"):
                write(store, predictions.record_outcome, added.id, fate == "success", "a note")
    return ids


def listed(store, **chosen):
    with store.read() as connection:
        return [item.id for item in prediction_lists.list_page(connection, PredictionFilter(**chosen), 50).items]


@pytest.mark.parametrize("limit", [1, 5, 12])
def test_every_page_goes_on_where_the_last_ended(store, mixed, limit):
    cursor, found = None, []
    with store.read() as connection:
        while not found or cursor is not None:
            page = prediction_lists.list_page(connection, PredictionFilter(), limit, cursor)
            found += [item.id for item in page.items]
            cursor = page.next_cursor
    assert found == [mixed[fate][k] for k in range(3) for fate in FATES]


def test_filters_narrow(store, mixed):
    other = predict(store, prediction_draft(task="other", model="regression", demonstration_ids=("c" * 32,)))
    for fate in FATES:
        assert listed(store, fate=fate, task=TASK) == mixed[fate]
    for chosen in ({"task": "other"}, {"model": "regression"}, {"num_demonstrations": 1}):
        assert listed(store, **chosen) == [other.id]
    assert listed(store, representation="absolute") == []
    assert read(store, prediction_lists.models) == ("embedded/gemma-3-270m", "regression")


def test_a_summary_has_the_outcome(store, mixed):
    items = read(store, prediction_lists.list_page, PredictionFilter(), 50).items
    assert [item.fate for item in items] == [*FATES] * 3
    assert {item.num_demonstrations for item in items} == {2}
    assert {item.error for item in items if item.fate == "refused"} == {REFUSED["error"]}


def test_outcomes_are_counted_by_configuration_the_surest_first(store, mixed):
    predict(store, prediction_draft(model="regression", request={"episode_ids": ["e"]}))
    solved = predict(store, prediction_draft(model="regression", request={"selection": "recent"}))
    write(store, predictions.record_outcome, solved.id, True, None)
    counted = read(store, prediction_lists.counts_by_configuration, TASK)
    found = [(way.model, way.selection, counts) for way, counts in counted.items()]
    assert found == [
        ("regression", "recent", Counts(1, 0, 1, 0)),  # at least 21 %; half of six are at least 19 %
        ("embedded/gemma-3-270m", "first", Counts(12, 3, 3, 3)),
        ("regression", None, Counts(1, 0, 0, 0)),
    ]
    assert read(store, prediction_lists.counts_by_configuration, "nothing") == {}
