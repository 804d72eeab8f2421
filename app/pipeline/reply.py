"""The LLM's reply -> actions, whole or in pieces.

A reply that does not parse is an error. It is never repaired.
"""

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.reasoning import DELIMITER
from app.pipeline.representation.base import Codec
from roboprompt_client.motion.limits import USUAL_ACTIONS
from roboprompt_client.types.poses import EndEffectorAction

MAX_REPLY_CHARS = 100_000
ROUNDING = 1e-9  # far below one unit of any representation


class ReplyReader:
    """Reads one reply piece by piece.

    Args:
        query: that the reply answers.
        max_actions: more than these are an error.
    """

    def __init__(self, codec: Codec, query: Query, max_actions: int = USUAL_ACTIONS) -> None:
        self._codec = codec
        self._decode = codec.decoder(query)
        self._max_actions = max_actions
        self._text = ""
        self._rows: list[str] = []
        self._actions: list[EndEffectorAction] = []

    def feed(self, piece: str) -> list[EndEffectorAction]:
        """The actions that `piece` completes.

        Raises:
            ReplyParseError: as soon as a completed row is not a valid action.
        """
        self._text += piece
        return self._read(self._text, complete=False)

    def finish(self, reply_text: str) -> tuple[EndEffectorAction, ...]:
        """All actions of the complete reply.

        Raises:
            ReplyParseError: if it is not one list of 1 to `max_actions` valid actions, or if it contradicts an action
                that was handed out while it arrived.
        """
        self._read(reply_text, complete=True)
        return tuple(self._actions)

    def _read(self, text: str, *, complete: bool) -> list[EndEffectorAction]:
        if len(text) > MAX_REPLY_CHARS:
            raise ReplyParseError(f"the reply is longer than {MAX_REPLY_CHARS} characters", text)
        if delimiter := DELIMITER.search(text):
            raise ReplyParseError(f"the reply contains reasoning ({delimiter.group()})", text)
        known = len(self._rows)
        try:
            rows = self._codec.rows(text, complete)
            if complete and rows[:known] != self._rows:
                again = self._decode(0, rows)
                if len(again) < len(self._actions) or not all(map(_same, self._actions, again)):
                    raise ReplyParseError("the complete reply contradicts the actions read while it arrived", text)
            new = self._decode(known, rows[known:])
            if (number := len(self._actions) + len(new)) > self._max_actions:
                raise ReplyParseError(f"the reply has {number} actions, more than {self._max_actions}", text)
        except ReplyParseError as error:
            raise ReplyParseError(error.message, text) from None
        self._rows, self._actions = rows, self._actions + new
        return new


def _same(a: EndEffectorAction, b: EndEffectorAction) -> bool:
    """Whether actions are equal up to rounding: rows decoded alone and among others may differ in the last bit."""
    return (
        np.allclose(a.position_m, b.position_m, rtol=0, atol=ROUNDING)
        and np.allclose(a.quaternion_xyzw, b.quaternion_xyzw, rtol=0, atol=ROUNDING)
        and a.gripper_open == b.gripper_open
    )
