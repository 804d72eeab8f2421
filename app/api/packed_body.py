"""A MessagePack body -> its document, within bounds that hold while it is unpacked."""

from typing import Any

import msgpack
from starlette.exceptions import HTTPException

from app.api.json_budget import MAX_DEPTH, MAX_VALUES
from app.pipeline.errors import InvalidInputError

# Lists and maps are made as long as they claim to be, before their items are read.
MAX_ITEMS = 4096


class _TooManyError(Exception):
    pass


class _Counter:
    """Counts the values of each list and map that is complete; within one that is not, `MAX_ITEMS` are the most."""

    def __init__(self) -> None:
        self._left = MAX_VALUES

    def __call__(self, container: Any) -> Any:  # noqa: ANN401
        self._left -= 1 + len(container)
        if self._left < 0:
            raise _TooManyError
        return container


def unpacked(data: bytes) -> dict[str, Any]:
    """The document, its arrays as maps and its bytes as they are.

    Raises:
        HTTPException: 413 for too many values, 400 for what is not MessagePack, or no map with keys of text.
    """
    counted = _Counter()
    try:
        document = msgpack.unpackb(
            data,
            max_array_len=MAX_ITEMS,
            max_map_len=MAX_ITEMS,
            max_ext_len=0,
            strict_map_key=True,
            list_hook=counted,
            object_hook=counted,
        )
    except _TooManyError:
        raise HTTPException(413, f"a MessagePack document may have at most {MAX_VALUES} values") from None
    except Exception as error:  # msgpack's own errors have no common class; some are ValueError, some are not
        raise HTTPException(400, f"body is not MessagePack: {str(error)[:200] or type(error).__name__}") from None
    if not isinstance(document, dict):
        raise HTTPException(400, f"body is a MessagePack {type(document).__name__}, expected a map")
    return {_text(key, "body"): value for key, value in document.items()}


def refuse_bytes(document: dict[str, Any]) -> None:
    """Let nothing but what JSON has into the document, which is stored as such.

    Raises:
        InvalidInputError: naming the place.
    """
    if (stranger := _stranger(document, 0)) is not None:
        path, fault, valid = stranger
        place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in reversed(path))
        raise InvalidInputError(place.removeprefix(".") or "body", fault, valid)


def _stranger(value: object, depth: int) -> tuple[list[str | int], str, str] | None:
    """Where there is something that JSON has not, from within outwards, what it is, and what would be valid."""
    if depth > MAX_DEPTH:
        return [], "lies too deep", f"at most {MAX_DEPTH} levels"
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(value, dict) and not isinstance(key, str):
                return [], f"has the key {key!r:.40}", "keys that are text"
            # the place is put together only where there is a fault: keys may be long, and items many
            if (stranger := _stranger(item, depth + 1)) is not None:
                stranger[0].append(key)
                return stranger
        return None
    if isinstance(value, str | int | float | bool | None):
        return None
    return [], f"is of the type {type(value).__name__}", "what JSON can say"


def _text(key: object, where: str) -> str:
    if not isinstance(key, str):
        raise InvalidInputError(where, f"has the key {key!r:.40}", "keys that are text")
    return key
