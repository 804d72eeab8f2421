"""Structured logs with ids, and traces that reach a collector."""

import gzip
import json

import httpx
import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from tests.e2e.processes import answering
from tests.reliability.service import QUESTION, TASK, serving, upload_files


@pytest.fixture(scope="module")
def collector():
    """(URL, the spans that it was sent)."""
    spans = []

    def collect(request, body):
        if request.headers.get("content-encoding") == "gzip":
            body = gzip.decompress(body)
        traced = ExportTraceServiceRequest.FromString(body)
        spans.extend(s for r in traced.resource_spans for scope in r.scope_spans for s in scope.spans)
        return 200, "application/x-protobuf", b""

    with answering(collect) as url:
        yield url, spans


@pytest.fixture(scope="module")
def seen(tmp_path_factory, collector):
    """What one upload and one prediction left: the prediction, the lines of the log, the spans."""
    url, spans = collector
    environment = {"ROBOPROMPT_LOG_FORMAT": "json", "ROBOPROMPT_OTEL_ENDPOINT": url}
    with serving(tmp_path_factory.mktemp("observed") / "data", environment) as service:
        with httpx.Client(base_url=service.url, headers={"X-Request-ID": "robot-7.1"}) as http:
            http.post("/episodes", files=upload_files(0)).raise_for_status()
            prediction = http.post("/predict", json=QUESTION)
            odd = http.get("/healthz", headers={"X-Request-ID": "two words"})
        service.process.terminate()
        service.process.wait(30)
        log = service.log()
    return prediction, odd, log, spans


def test_every_line_is_json_and_carries_ids(seen):
    prediction, odd, log, _ = seen
    lines = [json.loads(line) for line in log.splitlines()]
    (line,) = [item for item in lines if item.get("route") == "/predict"]
    assert (line["request_id"], line["task"], line["status"]) == ("robot-7.1", TASK, 200)
    assert line["prediction_id"] == prediction.json()["id"]
    assert line["duration_ms"] > 0
    (upload,) = [item for item in lines if item.get("route") == "/episodes"]
    assert (upload["task"], upload["method"], upload["status"]) == (TASK, "POST", 201)
    assert prediction.headers["x-request-id"] == "robot-7.1"
    assert len(odd.headers["x-request-id"]) == 32


def test_stages_are_spans_of_their_request(seen):
    *_, spans = seen
    (root,) = [span for span in spans if span.name == "POST /predict"]
    stages = {span.name for span in spans if span.trace_id == root.trace_id}
    assert {"read", "prompt", "llm", "write"} <= stages
