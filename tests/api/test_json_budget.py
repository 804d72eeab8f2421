import json
import random

import pytest
from starlette.exceptions import HTTPException

from app.api.decoding import JsonBudget

RANDOM = random.Random(0)


def made(depth=0):
    """A random document with awkward texts."""
    kind = RANDOM.random()
    if depth < 4 and kind < 0.3:
        return [made(depth + 1) for _ in range(RANDOM.randrange(4))]
    if depth < 4 and kind < 0.6:
        return {f'{RANDOM.random()}"\\[,{{': made(depth + 1) for _ in range(RANDOM.randrange(4))}
    return RANDOM.choice(['a"b', "\\", '\\"', '\\\\"[', "[[[,,,:::{{{", "", 1.5, None, True, "é"])


def values(document):
    """Containers with their items, a key counting as one; an empty container's comma is not there."""
    if isinstance(document, dict):
        return 1 + 2 * len(document) - bool(document) + sum(map(values, document.values()))
    if isinstance(document, list):
        return 1 + len(document) - bool(document) + sum(map(values, document))
    return 0


def feed(budget, pieces):
    for piece in pieces:
        budget.feed(piece)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 10_000])
def test_characters_within_texts_are_not_counted(size):
    for _ in range(300):
        document = made()
        text = json.dumps(document, ensure_ascii=RANDOM.random() < 0.5).encode()
        pieces = [text[at : at + size] for at in range(0, len(text), size)]
        feed(JsonBudget(max_values=values(document)), pieces)
        if values(document):
            with pytest.raises(HTTPException, match="at most"):
                feed(JsonBudget(max_values=values(document) - 1), pieces)


@pytest.mark.parametrize("size", [1, 5, 1000])
def test_levels_are_counted_across_pieces(size):
    wide = b"[" + b"[[]]," * 50 + b'{"[[[[[": [1]}]'
    pieces = [wide[at : at + size] for at in range(0, len(wide), size)]
    feed(JsonBudget(max_depth=3), pieces)
    with pytest.raises(HTTPException, match="at most 2 levels"):
        feed(JsonBudget(max_depth=2), pieces)


def test_other_encodings_are_refused():
    with pytest.raises(HTTPException, match="UTF-8") as caught:
        JsonBudget().feed('{"a": 1}'.encode("utf-16"))
    assert caught.value.status_code == 400
