"""The LLM's reply -> actions, as a whole or while it arrives, and several replies -> one list of actions.

What does not parse is an error.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.base import Codec
from roboprompt_client.motion_limits import MAX_ACTIONS
from roboprompt_client.trajectory import EndEffectorAction

MAX_REPLY_CHARS = 100_000
ROUNDING = 1e-9  # far below one unit of any representation


class ReplyReader:
    """Reads one reply piece by piece.

    Args:
        query: that the reply answers.
        max_actions: more than these are an error.
    """

    def __init__(self, codec: Codec, query: Query, max_actions: int = MAX_ACTIONS) -> None:
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
        """The actions that were not read before."""
        if len(text) > MAX_REPLY_CHARS:
            raise ReplyParseError(f"the reply is longer than {MAX_REPLY_CHARS} characters", text)
        known = len(self._rows)
        try:
            rows = self._codec.rows(text, complete)
            if len(rows) > self._max_actions:
                raise ReplyParseError(f"the reply has {len(rows)} actions, more than {self._max_actions}", text)
            if complete and rows[:known] != self._rows:
                self._check_same(self._decode(0, rows), text)
            new = self._decode(known, rows[known:])
        except ReplyParseError as error:
            raise ReplyParseError(error.message, text) from None
        self._rows, self._actions = rows, self._actions + new
        return new

    def _check_same(self, actions: Sequence[EndEffectorAction], text: str) -> None:
        """Refuse a complete reply whose first actions are not those that were read while it arrived."""
        early = self._actions
        if len(actions) < len(early) or not all(map(_same, early, actions)):
            raise ReplyParseError("the complete reply contradicts the actions read while it arrived", text)


def _same(a: EndEffectorAction, b: EndEffectorAction) -> bool:
    """Up to rounding: a row decoded alone may differ in the last bit from the same row decoded among others."""
    return (
        np.allclose(a.position_m, b.position_m, rtol=0, atol=ROUNDING)
        and np.allclose(a.quaternion_xyzw, b.quaternion_xyzw, rtol=0, atol=ROUNDING)
        and a.gripper_open == b.gripper_open
    )


@dataclass(frozen=True)
class Consensus:
    """What most samples agree on.

    Attributes:
        used: indices of the samples that the actions are made of.
    """

    actions: tuple[EndEffectorAction, ...]
    used: tuple[int, ...]


def consensus(samples: Sequence[Sequence[EndEffectorAction] | None]) -> Consensus:
    """The median of those samples that have as many actions as most of them.

    Args:
        samples: the actions of each reply; None for a reply that was not a list of valid actions.

    Raises:
        ReplyParseError: unless more than half of the samples are valid and have the same number of actions.
    """
    lengths = Counter(len(actions) for actions in samples if actions is not None)
    length, votes = lengths.most_common(1)[0] if lengths else (0, 0)
    if 2 * votes <= len(samples):
        said = ", ".join("invalid" if actions is None else str(len(actions)) for actions in samples)
        message = f"no more than half of the {len(samples)} samples have the same number of actions ({said})"
        raise ReplyParseError(message, "")
    agreeing = {k: actions for k, actions in enumerate(samples) if actions is not None and len(actions) == length}
    rows = zip(*agreeing.values(), strict=True)
    return Consensus(tuple(median_action(row) for row in rows), tuple(agreeing))


def median_action(actions: Sequence[EndEffectorAction]) -> EndEffectorAction:
    """Of each coordinate the median, of the rotations the chordal mean, and what the gripper does in most.

    The chordal mean minimises the summed squared Frobenius distances of rotation matrices (Hartley et al. 2013,
    "Rotation Averaging"). Where the gripper's states are equally many, the first action's counts.
    """
    position_m = np.median([action.position_m for action in actions], axis=0)
    rotation = Rotation.from_quat([action.quaternion_xyzw for action in actions]).mean()
    num_open = sum(action.gripper_open for action in actions)
    tied = 2 * num_open == len(actions)
    is_open = actions[0].gripper_open if tied else 2 * num_open > len(actions)
    return EndEffectorAction(position_m, rotation.as_quat(canonical=True), is_open)
