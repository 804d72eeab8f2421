"""The log of the whole process: no API key in it, and on demand one JSON object a line."""

import json
import logging
import re
from datetime import UTC, datetime
from typing import Any

from app.services.measures import current_fields

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
            **current_fields(),
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


def _without_keys(record: logging.LogRecord) -> bool:
    """A filter that lets every record pass, with a placeholder for what looks like an API key."""
    record.msg = _hidden(record.msg)
    if isinstance(record.args, tuple):
        record.args = tuple(map(_hidden, record.args))
    return True


def _hidden(value: Any) -> Any:  # noqa: ANN401
    return _KEY.sub(_HIDDEN, value) if isinstance(value, str) else value
