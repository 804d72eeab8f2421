"""How many values a JSON document has and how deep they lie, counted in its bytes before an object is made of any.

A megabyte of `[],[],[]` becomes 60 MB of objects, and the event loop stands still meanwhile.
"""

import re
from itertools import accumulate

MAX_VALUES = 20_000  # 64 objects with 64 mask ids have 9,000
MAX_DEPTH = 64
_ESCAPED = re.compile(rb"\\.", re.DOTALL)
_BRACKETS = b"[]{}"
_NOT_BRACKETS = bytes(set(range(256)) - set(_BRACKETS))
_STEP = {ord("["): 1, ord("{"): 1, ord("]"): -1, ord("}"): -1}


class JsonBudgetError(Exception):
    """The document is beyond its budget, or cannot be counted.

    Args:
        status: of the answer.
    """

    def __init__(self, detail: str, status: int = 413) -> None:
        super().__init__(detail)
        self.status = status


class JsonBudget:
    """Counts the signs that separate values, outside of strings; whether the text is JSON is the parser's matter.

    Args:
        max_values: a key counts as a value.
    """

    def __init__(self, max_values: int = MAX_VALUES, max_depth: int = MAX_DEPTH) -> None:
        self._max_values, self._max_depth = max_values, max_depth
        self._values = self._opened = self._depth = 0
        self._in_string = False
        self._half_escape = b""  # a backslash whose other half is in the next piece

    def feed(self, piece: bytes) -> None:
        """Count the document's next piece.

        Raises:
            JsonBudgetError: as soon as there are too many, or they lie too deep.
        """
        if b"\0" in piece:  # only in UTF-16 and UTF-32, where other characters hold the bytes that are counted
            raise JsonBudgetError("a JSON document is written in UTF-8", status=400)
        text = self._half_escape + piece
        if b"\\" in text:
            text = _ESCAPED.sub(b"", text)
        self._half_escape = b"\\" if text.endswith(b"\\") else b""
        between_quotes = text.split(b'"')
        outside = b"".join(between_quotes[self._in_string :: 2])
        if len(between_quotes) % 2 == 0:
            self._in_string = not self._in_string
        self._count(outside)

    def _count(self, outside: bytes) -> None:
        opened = outside.count(b"[") + outside.count(b"{")
        self._measure(outside, opened)
        self._values += outside.count(b",") + outside.count(b":") + opened
        if self._values > self._max_values:
            raise JsonBudgetError(f"a JSON document may have at most {self._max_values} values here")

    def _measure(self, outside: bytes, opened: int) -> None:
        self._opened += opened
        if self._opened <= self._max_depth:  # too few to lie too deep
            self._depth += opened - outside.count(b"]") - outside.count(b"}")
            return
        brackets = outside.translate(None, _NOT_BRACKETS)
        depths = list(accumulate(map(_STEP.__getitem__, brackets), initial=self._depth))
        self._depth = depths[-1]
        if max(depths) > self._max_depth:
            raise JsonBudgetError(f"a JSON document may have at most {self._max_depth} levels", status=400)
