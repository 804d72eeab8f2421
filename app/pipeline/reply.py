"""The LLM's reply -> actions, as a whole or while it arrives; what does not parse is an error."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.base import Codec
from roboprompt_client.motion_limits import MAX_ACTIONS
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

MAX_REPLY_CHARS = 100_000


class ReplyReader:
    """Reads one reply piece by piece.

    Args:
        objects: the observed objects that the actions may refer to.
        instruction: that the reply answers.
        max_actions: more than these are an error.
        start: where the end effector is before the first action, where that is known.
    """

    def __init__(
        self,
        codec: Codec,
        objects: Sequence[ObjectPose],
        instruction: str,
        max_actions: int = MAX_ACTIONS,
        start: EndEffectorAction | None = None,
    ) -> None:
        self._codec = codec
        self._objects = objects
        self._instruction = instruction
        self._max_actions = max_actions
        self._start = start
        self._text = ""
        self._actions: list[EndEffectorAction] = []

    def feed(self, piece: str) -> list[EndEffectorAction]:
        """The actions that `piece` completes.

        Raises:
            ReplyParseError: as soon as a completed row is not a valid action.
        """
        self._text += piece
        new = self._decode(self._text, complete=False, known=len(self._actions))
        self._actions += new
        return new

    def finish(self, reply_text: str) -> tuple[EndEffectorAction, ...]:
        """All actions of the complete reply.

        Raises:
            ReplyParseError: if it is not one list of 1 to `max_actions` valid actions, or if it contradicts an action
                that was handed out while it arrived.
        """
        actions = self._decode(reply_text, complete=True, known=0)
        early = self._actions
        if len(actions) < len(early) or not all(map(_same, early, actions)):
            raise ReplyParseError("the complete reply contradicts the actions read while it arrived", reply_text)
        return tuple(actions)

    def _decode(self, text: str, complete: bool, known: int) -> list[EndEffectorAction]:
        """The actions from row `known` on."""
        if len(text) > MAX_REPLY_CHARS:
            raise ReplyParseError(f"the reply is longer than {MAX_REPLY_CHARS} characters", text)
        try:
            rows = self._codec.rows(text, complete)
            if len(rows) > self._max_actions:
                raise ReplyParseError(f"the reply has {len(rows)} actions, more than {self._max_actions}", text)
            return self._codec.decode_rows(known, rows[known:], self._objects, self._instruction, self._start)
        except ReplyParseError as error:
            raise ReplyParseError(error.message, text) from None


def parse_reply(
    reply_text: str, codec: Codec, objects: Sequence[ObjectPose], instruction: str, max_actions: int = MAX_ACTIONS
) -> tuple[EndEffectorAction, ...]:
    """The actions of a whole reply.

    Raises:
        ReplyParseError: if the reply is not one list of 1 to `max_actions` valid actions; carries the reply.
    """
    return ReplyReader(codec, objects, instruction, max_actions).finish(reply_text)


def _same(a: EndEffectorAction, b: EndEffectorAction) -> bool:
    return (
        np.array_equal(a.position_m, b.position_m)
        and np.array_equal(a.quaternion_xyzw, b.quaternion_xyzw)
        and a.gripper_open == b.gripper_open
    )
