"""Optional packages, and drivers by name; both are imported only when a cell's file uses them."""

import importlib
from collections.abc import Mapping
from typing import Any

from roboprompt_client.errors import InvalidInputError


def import_extra(module: str, package: str, extra: str) -> Any:  # noqa: ANN401
    """Return a module of an optional package; raises InvalidInputError if it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        remedy = f"in a checkout, pip install './client[{extra}]'"
        raise InvalidInputError(extra, f"{package} is not installed or cannot be loaded: {error}", remedy) from error


def make_driver(field: str, name: str, known: Mapping[str, str], options: object) -> Any:  # noqa: ANN401
    """Return the driver that a factory makes.

    Args:
        field: the field that an error names, e.g. ``arm`` or ``cameras[front].driver``.
        name: one of `known`, or MODULE:FACTORY.
        known: MODULE:FACTORY by name.
        options: the factory's arguments by name.

    Raises:
        InvalidInputError: if the factory does not exist, or does not take these options.
    """
    module, colon, factory = known.get(name, name).partition(":")
    valid = ", ".join([*known, "MODULE:FACTORY"])
    if not colon:
        raise InvalidInputError(field, f"is {name!r:.80}", valid)
    try:
        make = getattr(importlib.import_module(module), factory)
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidInputError(field, f"{name!r:.80} cannot be imported: {error}", valid) from error
    within, dot, _ = field.rpartition(".")
    options_field = f"{within}{dot}options"
    if not isinstance(options, Mapping):
        raise InvalidInputError(options_field, f"are {options!r:.80}", "an object")
    try:
        return make(**options)
    except TypeError as error:
        raise InvalidInputError(options_field, f"do not fit {name}: {error}") from error
