"""A colour for each object that a page draws: where its name says one, that one, so that a blue cube is blue."""

from collections.abc import Iterable
from itertools import cycle

from app.perception.overlay import PALETTE
from app.pipeline.order.vocabulary import COLOURS

_BASIC = {
    "black": "#24292f", "white": "#f0f0f0", "red": "#d1242f", "green": "#2a9d50", "yellow": "#e3b91c",
    "blue": "#2f6fde", "brown": "#8a5a2b", "purple": "#8250df", "pink": "#e36bae", "orange": "#e67e22",
    "grey": "#8c959f",
}  # fmt: skip
_OTHERS = tuple(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in PALETTE)


def object_colours(names: Iterable[str]) -> dict[str, str]:
    """A colour as CSS writes it for each name; no two share one while there are enough."""
    wanted = list(dict.fromkeys(names))
    chosen: dict[str, str] = {}
    for name in wanted:
        if said := [color for color in _said(name) if color not in chosen.values()]:
            chosen[name] = said[0]
    free = cycle([color for color in (*_OTHERS, *_BASIC.values()) if color not in chosen.values()])
    return {name: chosen.get(name) or next(free) for name in wanted}


def _said(name: str) -> list[str]:
    """The colours of the words of the name; a word that may mean several counts for each."""
    words = name.casefold().replace("_", " ").split()
    return [_BASIC[basic] for word in words for basic in sorted(COLOURS.get(word, ()))]
