"""Optional packages, which are imported only when they are used."""

import importlib
from typing import Any

from roboprompt_client.errors import InvalidInputError


def import_extra(module: str, package: str, extra: str) -> Any:  # noqa: ANN401
    """Return a module of an optional package; raises InvalidInputError if it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        remedy = f"in a checkout, pip install './client[{extra}]'"
        raise InvalidInputError(extra, f"{package} is not installed or cannot be loaded: {error}", remedy) from error
