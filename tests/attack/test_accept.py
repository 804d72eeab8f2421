"""Accept headers by which nobody gets a stream who did not ask for one."""

import pytest

from tests.attack.payloads import QUESTION


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("text/event-stream", "text/event-stream"),
        ("TEXT/Event-Stream; q=0.1, */*", "text/event-stream"),
        ("text/event-stream;q=0, application/json", "application/json"),
        ("text/event-stream ; q = 0.000, */*", "application/json"),
        ("text/event-streams", "application/json"),
        (",;,q=1,text/*;" * 700, "application/json"),
    ],
)
def test_a_stream_comes_only_where_it_is_accepted(http, accept, media_type):
    answer = http.post("/predict", json=QUESTION, headers={"accept": accept})
    assert (answer.status_code, answer.headers["content-type"].partition(";")[0]) == (200, media_type)
