"""Episodes and predictions by their moment, finding and length."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from app.store import episodes, predictions
from app.store.filters import EpisodeFilter, PredictionFilter

from .drafts import episode_draft, predict, prediction_draft, read, upload

DAYS = [datetime(2026, 5, day, 12, tzinfo=UTC) for day in (1, 2, 3)]
CODES = ("few-frames", "few-frames-not", "far-from-objects")


def finding(code):
    return {"code": code, "severity": "info", "message": 'it says "code"', "where": ""}


def episode_by(store, number):
    draft = replace(episode_draft(number), created_at=DAYS[number], findings=(finding(CODES[number]),))
    return upload(store, replace(draft, num_frames=20 * (number + 1) + 1)).id


def prediction_by(store, number):
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
        ({"min_duration_s": 2}, [2, 1]),
        ({"max_duration_s": 2.0}, [1, 0]),
        ({"task": "other"}, []),
    ],
)
def test_episodes(store, chosen, expected):
    ids = [episode_by(store, number) for number in range(3)]
    page = read(store, episodes.list_page, EpisodeFilter(**chosen))
    assert [ids.index(item.id) for item in page.items] == expected


@pytest.mark.parametrize(("chosen", "expected"), [({"finding": "far-from-objects"}, [2])])
def test_predictions(store, chosen, expected):
    ids = [prediction_by(store, number) for number in range(3)]
    page = read(store, predictions.list_page, PredictionFilter(**chosen))
    assert [ids.index(item.id) for item in page.items] == expected
    later = PredictionFilter(created_from=page.items[0].created_at, **chosen) if page.items else PredictionFilter()
    assert len(read(store, predictions.list_page, later).items) == (1 if expected else 3)
