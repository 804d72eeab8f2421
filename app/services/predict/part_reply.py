"""The reply to one instruction -> actions that the demonstrations support, as its pieces arrive."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from app.llm.base import Completion, TextDelta
from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings.actions import ActionDoubt
from app.pipeline.plans.support import PlacedRow, SupportGuard
from app.pipeline.plans.turn import half_turned
from app.pipeline.reply import ReplyReader
from app.pipeline.workspace import ROTATION_BIN_DEG, DiscreteAction, discretize_actions
from app.services.measures import timed
from app.services.predict.question import Question
from app.store.values import JsonObject
from roboprompt_client.trajectory import EndEffectorAction

# What bins alone may do: half a bin where a demonstration was written, half where the reply is read; of rotations,
# three Euler angles together.
TOLERATED_BINS = 1.0
TOLERATED_DEG = 1.5 * ROTATION_BIN_DEG


@dataclass(frozen=True)
class PredictedAction:
    """An action with its bins.

    Attributes:
        row: the demonstrated row that it carries out; None where none is known.
    """

    action: EndEffectorAction
    discrete: DiscreteAction
    row: PlacedRow | None = None

    @cached_property
    def document(self) -> JsonObject:
        """As clients get it."""
        return {
            "position": self.action.position_m.tolist(),
            "quaternion_xyzw": self.action.quaternion_xyzw.tolist(),
            "gripper_open": self.action.gripper_open,
            "bins": list(self.discrete.bins),
            "clamped": self.discrete.clamped,
            "anchor": None if self.row is None else self._anchor(self.row),
        }

    def _anchor(self, row: PlacedRow) -> JsonObject:
        """What the action is relative to, so that a robot that looks again can follow it."""
        offset_m, rotation_xyzw = row.seen_from_anchor(self.action)
        return {
            "object": row.anchor.object_name or None,
            "frame": row.anchor.frame,
            "offset_m": offset_m.tolist(),
            "rotation_xyzw": rotation_xyzw.tolist(),
            "tolerance_m": row.tolerance_m,
            "tolerance_deg": row.tolerance_deg,
        }


class SupportCheck:
    """Holds the actions of the reply to one instruction against the demonstrations, as they come.

    Attributes:
        doubts: about actions that the request lets pass, and about those that lie beyond every demonstration.

    Args:
        num_before: actions of replies to earlier parts of the instruction.
    """

    def __init__(self, question: Question, instruction: str, num_before: int) -> None:
        plans = question.plans.get(instruction)
        self._guard = SupportGuard(plans, num_before) if plans else None
        self._allows = question.request.options.unsupported == "allow"
        self._tolerated_m = TOLERATED_BINS * float(question.known.settings.workspace.workspace().bin_size_m.max())
        self._index = num_before
        self.doubts: list[ActionDoubt] = []

    def check(self, action: EndEffectorAction) -> PlacedRow | None:
        """Let the next action pass; the demonstrated row that it carries out, None where none is known.

        Raises:
            UnsupportedActionError: unless the request lets it pass.
        """
        index, self._index = self._index, self._index + 1
        if self._guard is None:
            return None
        try:
            row = self._guard.check(action)
        except UnsupportedActionError as error:
            self._let_pass(error, index)
            self._guard.pass_by()
            return None
        beyond_m, beyond_deg = row.beyond(action)
        if beyond_m > self._tolerated_m or beyond_deg > TOLERATED_DEG:
            seen_from = row.anchor.object_name or f"the {row.anchor.frame}"
            self.doubts.append(ActionDoubt(index, beyond_m, beyond_deg, seen_from))
        return row

    def finish(self) -> None:
        """Let the reply end; raises as `check`."""
        try:
            if self._guard is not None:
                self._guard.finish()
        except UnsupportedActionError as error:
            self._let_pass(error, self._index)

    def _let_pass(self, error: UnsupportedActionError, index: int) -> None:
        if not self._allows:
            raise error
        self.doubts.append(ActionDoubt(index, unsupported=error))


class PartReply:
    """The reply to one part of an instruction.

    Attributes:
        support: holds its actions against the demonstrations.
        complete: whether all of it was read.

    Args:
        num_before: actions of the replies to earlier parts.
    """

    def __init__(self, question: Question, asked: Query, num_before: int) -> None:
        remaining = question.request.options.max_actions - num_before
        self._question = question
        self._reader = ReplyReader(question.template.codec, asked, remaining)
        self._num_read = 0
        self.support = SupportCheck(question, asked.instruction, num_before)
        self.complete = False

    def read(self, piece: TextDelta | Completion) -> list[PredictedAction]:
        """The actions that a piece of the reply completes.

        Raises:
            ReplyParseError, UnsupportedActionError.
        """
        with timed("parse"):
            if isinstance(piece, TextDelta):
                new = self._reader.feed(piece.text)
            elif piece.finish_reason == "length":
                tokens = piece.usage.completion_tokens
                raise ReplyParseError(f"the reply was cut off after {tokens} tokens", piece.text)
            else:
                new = list(self._reader.finish(piece.text)[self._num_read :])
                self.complete = True
        self._num_read += len(new)
        if self._question.turned:
            new = [half_turned(action) for action in new]
        return predicted(new, [self.support.check(action) for action in new], self._question)


def predicted(
    actions: Sequence[EndEffectorAction], rows: Sequence[PlacedRow | None], question: Question
) -> list[PredictedAction]:
    """The actions with their bins, each with the demonstrated row that it carries out."""
    bins = discretize_actions(actions, question.known.settings.workspace.workspace())
    return list(map(PredictedAction, actions, bins, rows))
