"""The LLM's reply -> actions, whole or in pieces; several replies -> the one that most others agree with.

A reply that does not parse is an error. It is never repaired.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.reasoning import DELIMITER
from app.pipeline.representation.base import Codec
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.motion.limits import USUAL_ACTIONS
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

MAX_REPLY_CHARS = 100_000
ROUNDING = 1e-9  # far below one unit of any representation
SAME_WAY_M = 0.04  # replies whose actions differ by less go one way; demonstrations that do are one plan, too


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
        """The actions of rows that were not read before."""
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


@dataclass(frozen=True)
class Consensus:
    """The sample that is the answer, and those that agree with it.

    Attributes:
        chosen: its index.
        alike: the indices of the samples whose actions are nearly the same, the chosen one among them.
    """

    chosen: int
    alike: tuple[int, ...]


def consensus(samples: Sequence[Sequence[EndEffectorAction] | None]) -> Consensus:
    """The medoid of the largest cluster of samples: the one that differs least from those that do the same.

    It is a reply that was said as a whole. A mean or median of several is not: of two ways round an obstacle it goes
    through it. Of clusters that are equally large the one that differs less within counts.

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
    places, apart_m = list(agreeing), _apart_m(list(agreeing.values()))
    sums_m = {
        (*cluster,): apart_m[np.ix_(cluster, cluster)].sum(axis=1) for cluster in _clusters(apart_m <= SAME_WAY_M)
    }
    largest = min(sums_m, key=lambda cluster: (-len(cluster), sums_m[cluster].sum()))
    medoid = largest[int(sums_m[largest].argmin())]
    return Consensus(places[medoid], tuple(places[k] for k in largest))


def _apart_m(replies: Sequence[Sequence[EndEffectorAction]]) -> Array:
    """(N, N) how far replies with equally many actions differ where they differ most; rotations weigh in as meters.

    Replies that do otherwise with the gripper are infinitely far from each other.
    """
    positions_m = np.array([[action.position_m for action in reply] for reply in replies])
    turns = np.array([[action.quaternion_xyzw for action in reply] for reply in replies])
    states = np.array([[action.gripper_open for action in reply] for reply in replies])
    off_m = np.linalg.norm(positions_m[:, None] - positions_m[None], axis=3)
    off_m += M_PER_RAD * quaternions.angles_rad(turns[:, None], turns[None])
    off_m[states[:, None] != states[None]] = np.inf
    apart_m: Array = off_m.max(axis=2)
    np.fill_diagonal(apart_m, 0.0)
    return apart_m


def _clusters(near: np.ndarray) -> list[list[int]]:
    """The indices that are linked to each other by steps between near ones."""
    number, labels = connected_components(near, directed=False)
    return [np.flatnonzero(labels == label).tolist() for label in range(number)]
