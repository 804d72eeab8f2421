"""How far a re-extraction is, as the page Now tells it."""

from datetime import UTC, datetime, timedelta

import pytest

from app.store.records import JobRecord
from app.web.page import render_part
from app.web.routes.live import job_left_s


def job(status, num_extracted, error=None):
    now = datetime.now(UTC)
    begun = now - timedelta(seconds=30)
    return JobRecord(1, "j", "pick", {}, status, 400, num_extracted, error, None, now, begun, None)


def test_the_time_left_follows_the_pace_so_far():
    assert job_left_s(job("running", 100)) == pytest.approx(90, rel=0.01)
    assert job_left_s(job("running", 400)) == 0


@pytest.mark.parametrize(("status", "num_extracted"), [("queued", 0), ("running", 0), ("done", 400), ("failed", 10)])
def test_it_is_unknown_before_the_first_batch_and_after_the_end(status, num_extracted):
    assert job_left_s(job(status, num_extracted)) is None


def test_progress_and_errors_are_reported():
    shown = [(job("running", 100), 90.0), (job("failed", 10, "cube: is not in view"), None)]
    html = render_part("live_now.html", running=[], jobs=shown, root="")
    assert "100 of 400 episodes, about 90 s left" in html
    assert 'max="400" value="100"' in html
    assert "cube: is not in view" in html
