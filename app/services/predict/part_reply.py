"""The reply to one instruction -> actions that the demonstrations support, as its pieces arrive."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.llm.base import Completion, TextDelta
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.reply import ReplyReader
from app.pipeline.representation.frame_text import XYZ, FrameParts
from app.pipeline.skill import turns
from app.pipeline.skill.support import PlacedPlan, PlacedRow, SupportGuard
from app.pipeline.skill.wrist import half_turned
from app.pipeline.workspace import ROTATION_BIN_DEG, DiscreteAction, Workspace, discretize_actions
from app.services.measures import timed
from app.store.values import JsonObject
from roboprompt_client.types.poses import EndEffectorAction

# What bins alone may do: half a bin where a demonstration was written, half where the reply is read; of rotations,
# three Euler angles together.
TOLERATED_BINS = 1.0
TOLERATED_DEG = 1.5 * ROTATION_BIN_DEG


@dataclass(frozen=True)
class ActionDoubt:
    """An action outside of the demonstrated range.

    Attributes:
        index: of the action, from 0.
        off_m, off_deg: how far it is beyond the farthest demonstration.
        seen_from: what it follows, in words.
        unsupported: the reason for refusing it, unless the request allows it; None if it is within the margin.
    """

    index: int
    off_m: float = 0.0
    off_deg: float = 0.0
    seen_from: str = ""
    unsupported: UnsupportedActionError | None = None


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
        return {
            "position": self.action.position_m.tolist(),
            "quaternion_xyzw": self.action.quaternion_xyzw.tolist(),
            "gripper_open": self.action.gripper_open,
            "bins": list(self.discrete.bins),
            "clamped": self.discrete.clamped,
            "anchor": None if self.row is None else anchor_document(self.row, self.action),
        }


def anchor_document(placed: PlacedRow, action: EndEffectorAction) -> JsonObject:
    """Return the frame that an action is relative to, so that a robot that looks again can follow it."""
    parts, (offset_m, rotation_xyzw) = FrameParts.of(placed.row.frame), placed.seen(action)
    tolerance_m, tolerance_deg = placed.tolerance
    names = placed.names
    middle = names[parts.base.other] if parts.base.kind == "between" else None
    along: dict[str, str | None] = dict.fromkeys(XYZ, middle) if middle is not None else {}
    along |= {XYZ[axis]: names.get(source.one) for axis, source in parts.along.items()}
    others = {"axes": parts.axes, "hand": parts.hand}
    return {
        "object": placed.object_name or None,
        "frame": parts.code,
        **({"toward": names[parts.toward]} if parts.toward else {}),
        **({"along": along} if along else {}),
        **({"share": 0.5} if middle is not None else {}),
        **{name: [names[key] for key in of.objects] for name, of in others.items() if of is not None},
        "offset_m": offset_m.tolist(),
        "rotation_xyzw": turns.canonical(rotation_xyzw).tolist(),
        "tolerance_m": tolerance_m,
        "tolerance_deg": tolerance_deg,
    }


class PartReply:
    """The reply to one part of an instruction: pieces -> rows -> actions that the demonstrations support.

    Attributes:
        doubts: about actions that the request lets pass, and about those that lie beyond every demonstration.
        complete: whether all of it was read.

    Args:
        plans: the demonstrated rows placed in the scene; None or empty where unknown.
        num_before: actions of the replies to earlier parts.
        turned: whether the hand is turned by 180 degrees from what the reply says.
        allows: whether actions that the demonstrations do not support pass.
    """

    def __init__(
        self,
        reader: ReplyReader,
        plans: Sequence[PlacedPlan] | None,
        workspace: Workspace,
        num_before: int,
        *,
        turned: bool,
        allows: bool,
    ) -> None:
        self._reader, self._workspace = reader, workspace
        self._tolerated_m = TOLERATED_BINS * float(workspace.bin_size_m.max())
        rounding = np.repeat([self._tolerated_m, np.radians(TOLERATED_DEG)], 3)
        self._guard = SupportGuard(plans, rounding, num_before) if plans else None
        self._turned, self._allows = turned, allows
        self._num_before, self._num_read = num_before, 0
        self.doubts: list[ActionDoubt] = []
        self.complete = False

    def read(self, piece: TextDelta | Completion) -> list[PredictedAction]:
        """The actions that a piece of the reply completes.

        Raises:
            ReplyParseError: if it is not a list of valid actions.
            UnsupportedActionError: unless the request lets it pass; also of a reply that ends too early.
        """
        with timed("parse"):
            new = self._parsed(piece)
        actions = [half_turned(action) for action in new] if self._turned else new
        rows = [self._row(index, action) for index, action in enumerate(actions, self._num_before + self._num_read)]
        self._num_read += len(new)
        if self.complete and self._guard is not None:
            try:
                self._guard.finish()
            except UnsupportedActionError as error:
                self._let_pass(error, self._num_before + self._num_read)
        return list(map(PredictedAction, actions, discretize_actions(actions, self._workspace), rows))

    def _parsed(self, piece: TextDelta | Completion) -> Sequence[EndEffectorAction]:
        if isinstance(piece, TextDelta):
            return self._reader.feed(piece.text)
        if piece.finish_reason == "length":
            tokens = piece.usage.completion_tokens
            raise ReplyParseError(f"the reply was cut off after {tokens} tokens", piece.text)
        self.complete = True
        return self._reader.finish(piece.text)[self._num_read :]

    def _row(self, index: int, action: EndEffectorAction) -> PlacedRow | None:
        """The demonstrated row that the next action carries out; None where none is known."""
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
            self.doubts.append(ActionDoubt(index, beyond_m, beyond_deg, row.described))
        return row

    def _let_pass(self, error: UnsupportedActionError, index: int) -> None:
        if not self._allows:
            raise error
        self.doubts.append(ActionDoubt(index, unsupported=error))
