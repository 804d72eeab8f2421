"""What an address may ask of a list."""

from datetime import UTC, datetime

import pytest
from pydantic import ValidationError

from app.api.schemas.lists import EpisodesQuery, PredictionsQuery
from app.store.filters import EpisodeFilter, PredictionFilter


def test_a_date_counts_from_its_beginning_to_its_end_in_utc():
    chosen = EpisodesQuery(created_from="2026-05-01", created_to="2026-05-02").filter()
    assert chosen.created_from == datetime(2026, 5, 1, tzinfo=UTC)
    assert chosen.created_to == datetime(2026, 5, 2, 23, 59, 59, 999999, tzinfo=UTC)
    exact = PredictionsQuery(created_from="2026-05-01T10:00:00+02:00", created_to="2026-05-02T08:00").filter()
    assert exact.created_from == datetime(2026, 5, 1, 8, tzinfo=UTC)
    assert exact.created_to == datetime(2026, 5, 2, 8, tzinfo=UTC)


def test_nothing_asked_is_nothing_filtered():
    assert EpisodesQuery().filter() == EpisodeFilter()
    assert not EpisodeFilter(task="any").is_set
    assert PredictionsQuery(outcome="unknown").filter() == PredictionFilter(outcome="unknown")


@pytest.mark.parametrize(
    "asked",
    [
        {"created_from": "0001-01-01T00:00:00+14:00"},
        {"created_to": "9999-12-31T23:59:59-14:00"},
        {"created_to": "2026-02-30"},
        {"min_duration_s": float("nan")},
        {"max_duration_s": -1},
        {"cursor": 0},
    ],
)
def test_what_cannot_be_is_refused(asked):
    with pytest.raises(ValidationError):
        EpisodesQuery(**asked)
    with pytest.raises(ValidationError):
        PredictionsQuery(finding='a"b')
