"""What the service's log shows besides uvicorn's lines: who changed what; and what it must not show: keys."""

import logging
import re
from typing import Any

from app.api.access import CHANGES

_KEY = re.compile(r"rp_[0-9a-f]{12}_[\w-]{8,}")


def set_up_logs() -> None:
    """Hide keys in the access log, where a client may put one into an address by mistake, and show `CHANGES`."""
    logging.getLogger("uvicorn.access").addFilter(_without_keys)  # adding it again changes nothing
    changes = logging.getLogger(CHANGES)
    changes.setLevel(logging.INFO)
    changes.addFilter(_without_keys)
    if not changes.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(name)s %(message)s"))
        changes.addHandler(handler)


def _without_keys(record: logging.LogRecord) -> bool:
    """A filter that lets every record pass, with a placeholder for what looks like an API key."""
    record.msg = _hidden(record.msg)
    if isinstance(record.args, tuple):
        record.args = tuple(map(_hidden, record.args))
    return True


def _hidden(value: Any) -> Any:  # noqa: ANN401
    return _KEY.sub("rp_(hidden)", value) if isinstance(value, str) else value
