"""Episodes and predictions by their moment, finding, author and length."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from app.store import api_keys, episodes, predictions, tables
from app.store.api_keys import ApiKeyRecord
from app.store.filters import EpisodeFilter, PredictionFilter, authors
from app.store.visibility import Visibility, seeing

from .drafts import episode_draft, predict, prediction_draft, read, upload, write

DAYS = [datetime(2026, 5, day, 12, tzinfo=UTC) for day in (1, 2, 3)]
CODES = ("few-frames", "few-frames-not", "far-from-objects")


def finding(code):
    return {"code": code, "severity": "info", "message": 'it says "code"', "where": ""}


@pytest.fixture
def keys(store):
    for number, name in enumerate(("ann", "ann", "bob")):
        record = ApiKeyRecord(f"key{number}", name, f"digest{number}", ("upload",), DAYS[0])
        write(store, api_keys.add, record)


def episode_by(store, number):
    draft = replace(episode_draft(number), created_at=DAYS[number], findings=(finding(CODES[number]),))
    return upload(store, replace(draft, num_frames=20 * (number + 1) + 1, key_id=f"key{number}")).id


def prediction_by(store, number):
    with seeing(Visibility(f"key{number}")):
        return predict(store, prediction_draft(findings=(finding(CODES[number]),))).id


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, [2, 1, 0]),
        ({"created_from": DAYS[1]}, [2, 1]),
        ({"created_to": DAYS[1]}, [1, 0]),
        ({"created_from": DAYS[1], "created_to": DAYS[1]}, [1]),
        ({"finding": "few-frames"}, [0]),
        ({"finding": "few-fram_s"}, []),
        ({"author": "ann"}, [1, 0]),
        ({"author": "nobody"}, []),
        ({"min_duration_s": 2}, [2, 1]),
        ({"max_duration_s": 2.0, "author": "ann"}, [1, 0]),
        ({"task": "other"}, []),
    ],
)
def test_episodes(store, keys, chosen, expected):
    ids = [episode_by(store, number) for number in range(3)]
    page = read(store, episodes.list_page, EpisodeFilter(**chosen))
    assert [ids.index(item.id) for item in page.items] == expected


@pytest.mark.parametrize(
    ("chosen", "expected"), [({"finding": "far-from-objects"}, [2]), ({"author": "ann"}, [1, 0]), ({"cases": True}, [])]
)
def test_predictions(store, keys, chosen, expected):
    ids = [prediction_by(store, number) for number in range(3)]
    page = read(store, predictions.list_page, PredictionFilter(**chosen))
    assert [ids.index(item.id) for item in page.items] == expected
    later = PredictionFilter(created_from=page.items[0].created_at, **chosen) if page.items else PredictionFilter()
    assert len(read(store, predictions.list_page, later).items) == (1 if expected else 3)


def test_authors_are_those_of_what_a_key_sees(store, keys):
    for number in (0, 2):
        episode_by(store, number)
        prediction_by(store, number)
    for table in (tables.episodes, tables.predictions):
        assert read(store, authors, table) == ("ann", "bob")
    with seeing(Visibility("key2", reads=False)):
        assert read(store, authors, tables.predictions) == ("bob",)
    with seeing(Visibility("key2", tasks=("other",))):
        assert read(store, authors, tables.episodes) == ()
