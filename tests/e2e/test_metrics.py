"""What `/metrics` counts."""

from prometheus_client.parser import text_string_to_metric_families

from tests.episodes import metadata, upload


def counted(http, name, **labels):
    """The value of one sample; 0 while there is none."""
    answer = http.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    samples = [sample for family in text_string_to_metric_families(answer.text) for sample in family.samples]
    found = [s.value for s in samples if s.name == name and labels.items() <= s.labels.items()]
    return sum(found)


def test_predictions_tokens_outcomes_and_requests(http):
    for place_m in ((0.1, 0.1, 0.78), (0.2, -0.1, 0.78)):
        upload(http, "counted", place_m)
    of_model = {"model": "nearest", "status": "ok"}
    stage = {"model": "nearest", "stage": "outside_llm"}  # of failed predictions, too
    before = counted(http, "roboprompt_predictions_total", **of_model)
    before_timed = counted(http, "roboprompt_prediction_stage_seconds_count", **stage)
    question = metadata("counted", {"cube": (0.15, 0.0, 0.78)}, model="nearest")
    answer = http.post("/predict", json=question).json()
    assert counted(http, "roboprompt_predictions_total", **of_model) == before + 1
    assert counted(http, "roboprompt_llm_tokens_total", model="nearest", kind="prompt_tokens") > 0
    assert counted(http, "roboprompt_prediction_stage_seconds_count", **stage) == before_timed + 1
    successes = {"model": "nearest", "success": "true"}
    outcomes_before = counted(http, "roboprompt_outcomes_total", **successes)
    http.post(f"/predictions/{answer['id']}/outcome", json={"success": True})
    assert counted(http, "roboprompt_outcomes_total", **successes) == outcomes_before + 1


def test_a_reply_that_does_not_parse_is_counted(http):
    upload(http, "counted", (0.1, 0.1, 0.78))
    http.post("/predict", json=metadata("counted", {"cube": (0.15, 0.0, 0.78)}, model="scripted"))
    assert counted(http, "roboprompt_predictions_total", model="scripted", status="parse_error") >= 1


def test_routes_are_templates(http):
    http.get("/tasks/never-heard-of")
    http.get("/nothing/at/all")
    http.request("BREW", "/healthz")
    missing = {"route": "/tasks/{name}", "status": "404", "method": "GET"}
    assert counted(http, "roboprompt_http_request_seconds_count", **missing) >= 1
    text = http.get("/metrics").text
    assert "never-heard-of" not in text
    assert "/nothing/at/all" not in text
    assert "BREW" not in text
