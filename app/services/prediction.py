"""What a prediction gives."""

from dataclasses import dataclass

from app.llm.base import Completion
from app.pipeline.episode import EndEffectorAction
from app.pipeline.findings import Finding
from app.pipeline.plans.support import PlacedRow
from app.pipeline.prompt import Prompt
from app.pipeline.representation.anchors import relative_pose
from app.pipeline.workspace import DiscreteAction
from app.services.question import Question
from app.store.values import JsonObject


@dataclass(frozen=True)
class PredictedAction:
    """An action with its bins.

    Attributes:
        row: the demonstrated row that it carries out; None where none is known.
    """

    action: EndEffectorAction
    discrete: DiscreteAction
    row: PlacedRow | None = None

    def to_json(self) -> JsonObject:
        """As clients get it."""
        return {
            "position": self.action.position_m.tolist(),
            "quaternion_xyzw": self.action.quaternion_xyzw.tolist(),
            "gripper_open": self.action.gripper_open,
            "bins": list(self.discrete.bins),
            "clamped": self.discrete.clamped,
            "anchor": self._anchor(),
        }

    def _anchor(self) -> JsonObject | None:
        """What the action hangs on, so that a robot that looks again can follow it."""
        if (row := self.row) is None:
            return None
        offset_m, rotation = relative_pose(row.origin_m, row.axes, self.action)
        return {
            "object": row.anchor.object_name or None,
            "frame": row.anchor.frame,
            "offset_m": offset_m.tolist(),
            "rotation_xyzw": rotation.as_quat(canonical=True).tolist(),
            "tolerance_m": row.tolerance_m,
            "tolerance_deg": row.tolerance_deg,
        }


@dataclass(frozen=True, eq=False)
class Prediction:
    """A recorded answer.

    Attributes:
        prompt: the last that the LLM was asked: with several instructions it holds the replies to those before.
        samples: where several replies were asked for, each of them.
        findings: what deserves a look.
    """

    id: str
    question: Question
    prompt: Prompt
    actions: tuple[PredictedAction, ...]
    completion: Completion
    timings_ms: dict[str, float]
    samples: tuple[JsonObject, ...] | None = None
    findings: tuple[Finding, ...] = ()
