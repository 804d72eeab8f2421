"""No API key in the log, also where somebody puts one into an address by mistake."""

import logging
import re

_KEY = re.compile(r"rps?_[0-9a-f]{12}_[\w-]{8,}")
_HIDDEN = "rp_(hidden)"


class HideKeys(logging.Filter):
    """Hides what looks like an API key in a record's message and arguments."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Let every record pass, without keys."""
        if isinstance(record.msg, str):
            record.msg = without_keys(record.msg)
        if isinstance(record.args, tuple):
            record.args = tuple(without_keys(item) if isinstance(item, str) else item for item in record.args)
        return True


def hide_keys_in_access_log() -> None:
    """Install the filter where addresses are logged."""
    logger = logging.getLogger("uvicorn.access")
    if not any(isinstance(item, HideKeys) for item in logger.filters):
        logger.addFilter(HideKeys())


def without_keys(text: str) -> str:
    """`text` with a placeholder for every API key in it."""
    return _KEY.sub(_HIDDEN, text)
