"""A stream of server-sent events (HTML standard, section 9.2), as far as a service of JSON events needs it."""

import codecs
import json
from collections.abc import Iterable, Iterator
from typing import Any

import httpx

EVENT_STREAM = "text/event-stream"


class NotEventsError(ValueError):
    """What came is no stream of JSON events."""


def events_of(response: httpx.Response) -> Iterator[tuple[str, dict[str, Any]]]:
    """The events of an answer that is being read; raises as `events`."""
    kind = response.headers.get("content-type", "")
    if kind.partition(";")[0].strip() != EVENT_STREAM:
        raise NotEventsError(f"the answer is {kind or 'of no type'!r:.80}, not {EVENT_STREAM}")
    yield from events(response.iter_bytes())


def events(pieces: Iterable[bytes]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The name and the JSON object of each event, as soon as it is complete; one that is cut off is none.

    Raises:
        NotEventsError: for data that are no JSON object, or no UTF-8.
    """
    name, data = "message", []
    for line in _lines(pieces):
        if line:
            field, _, value = line.partition(":")
            value = value[1:] if value.startswith(" ") else value
            if field == "event":
                name = value
            elif field == "data":
                data.append(value)
            continue
        if data:
            yield name, _document(name, "\n".join(data))
        name, data = "message", []


def _document(name: str, data: str) -> dict[str, Any]:
    try:
        document = json.loads(data)
    except ValueError:
        document = None
    if not isinstance(document, dict):
        raise NotEventsError(f"the data of the event {name!r:.40} are no JSON object: {data!r:.80}")
    return document


def _lines(pieces: Iterable[bytes]) -> Iterator[str]:
    """Without their ends. U+2028 and the like do not end a line here, as they do for `str.splitlines`."""
    decoder, rest = codecs.getincrementaldecoder("utf-8")(), ""
    for piece in pieces:
        try:
            *lines, rest = (rest + decoder.decode(piece)).split("\n")
        except UnicodeDecodeError as error:
            raise NotEventsError(f"the stream is no UTF-8: {error}") from error
        for line in lines:
            yield line.removesuffix("\r")
