"""Logs and traces of the whole process.

The log contains no API key and has one JSON object a line if asked for. Traces go to an OpenTelemetry collector: a span
for each request, and below it one for each stage of a prediction.
"""

import json
import logging
import re
from datetime import UTC, datetime
from typing import Any

from fastapi import FastAPI

from app.api.access import CHANGES
from app.services import measures
from roboprompt_client.http import is_own_machine

_OWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message", "taskName"}
_KEY = re.compile(r"rps?_[0-9a-f]{12}_[\w-]{8,}")
_HIDDEN = "rp_(hidden)"


class JsonFormatter(logging.Formatter):
    """`{"time", "level", "logger", "message", ...}` with the request's fields and those of `extra`."""

    def format(self, record: logging.LogRecord) -> str:
        document: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **measures.current_fields(),
            **{name: value for name, value in vars(record).items() if name not in _OWN},
        }
        if record.exc_info:
            document["exception"] = self.formatException(record.exc_info)
        return json.dumps(document, default=str)


def log_as_json() -> None:
    """Send every logger's lines, uvicorn's too, to standard error; `app.api.middleware` logs the requests."""
    handler = logging.StreamHandler()
    handler.setFormatter(JsonFormatter())
    logging.basicConfig(handlers=[handler], level=logging.INFO, force=True)
    for chatty in ("uvicorn.access", "httpx"):
        logging.getLogger(chatty).setLevel(logging.WARNING)


def hide_keys_in_access_log() -> None:
    """Hide API keys where addresses are logged: a client may put one into an address by mistake."""
    logging.getLogger("uvicorn.access").addFilter(_without_keys)  # adding it again changes nothing


def show_changes() -> None:
    """Write the lines of `CHANGES` to standard error, whatever else is logged."""
    logger = logging.getLogger(CHANGES)
    logger.setLevel(logging.INFO)
    if not logger.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(name)s %(message)s"))
        handler.addFilter(_without_keys)
        logger.addHandler(handler)


def _without_keys(record: logging.LogRecord) -> bool:
    """A filter that lets every record pass, with a placeholder for what looks like an API key."""
    record.msg = _hidden(record.msg)
    if isinstance(record.args, tuple):
        record.args = tuple(map(_hidden, record.args))
    return True


def _hidden(value: Any) -> Any:  # noqa: ANN401
    return _KEY.sub(_HIDDEN, value) if isinstance(value, str) else value


class Tracing:
    """Sends traces to an OTLP collector; the extra `otel` has the packages.

    Args:
        endpoint: its HTTP address, e.g. ``http://127.0.0.1:4318``.

    Raises:
        ModuleNotFoundError: if the packages are not installed.
    """

    def __init__(self, endpoint: str) -> None:
        import requests
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor

        self._provider = TracerProvider(resource=Resource.create({"service.name": "roboprompt"}))
        session = requests.Session()
        session.trust_env = not is_own_machine(endpoint)
        exporter = OTLPSpanExporter(endpoint=f"{endpoint.rstrip('/')}/v1/traces", session=session)
        self._provider.add_span_processor(BatchSpanProcessor(exporter))

    def install(self, app: FastAPI) -> None:
        """Trace `app` from now on."""
        from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor

        urls = "healthz,readyz,metrics"
        FastAPIInstrumentor.instrument_app(app, tracer_provider=self._provider, excluded_urls=urls)
        measures.trace_with(self._provider.get_tracer("roboprompt"))

    def close(self) -> None:
        """Send what is left. Blocking: call it in a thread."""
        measures.trace_with(None)
        self._provider.shutdown()
