"""What a robot asks, the question for the LLM that `write` makes of it, and what a prediction gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from app.llm.base import Completion, ModelProfile
from app.perception.base import ObjectQuery
from app.perception.images import ImageBytes
from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan, PlacedRow
from app.pipeline.prompt import Prompt, PromptTemplate
from app.pipeline.representation.base import Codec
from app.pipeline.workspace import DiscreteAction
from app.services.predict.options import AS_THE_TASK_SAYS, PredictOptions
from app.services.predict.template import PromptStyle, Shown
from app.services.task_settings import TaskSettings
from app.store.values import JsonObject
from app.voxposer.prompt import ProgramTemplate
from app.voxposer.scene import Scene
from roboprompt_client.camera import Camera, RgbdFrame
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose


@dataclass(frozen=True)
class PredictRequest:
    """What a robot asks.

    Attributes:
        objects: the observed objects, in any order.
        frames: calibrated images, for estimators that look.
        cameras: those of the frames, where these are no longer kept.
        images: the same as they came, by camera, to be stored with the prediction.
        end_effector: where the robot's end effector is, where the robot tells.
        meaning: the instruction of the task that `instruction` means, where an LLM was asked for it.
        as_sent: the request as it came, to be stored with the prediction.
    """

    task: str
    instruction: str
    objects: tuple[ObjectQuery, ...]
    frames: tuple[RgbdFrame, ...] = ()
    cameras: tuple[Camera, ...] = ()
    images: Mapping[str, ImageBytes] = field(default_factory=dict)
    end_effector: Pose | None = None
    meaning: str | None = None
    options: PredictOptions = AS_THE_TASK_SAYS
    as_sent: JsonObject = field(default_factory=dict)

    def without_frames(self) -> "PredictRequest":
        """The same with the cameras, but without what was decoded."""
        return replace(self, cameras=tuple(frame.camera for frame in self.frames), frames=())

    def with_options(self, **changes: Any) -> "PredictRequest":  # noqa: ANN401
        """The same with these options, which are checked, and the others as they are."""
        kept = {name: getattr(self.options, name) for name in PredictOptions.model_fields}
        return replace(self, options=PredictOptions.model_validate(kept | changes))

    def __post_init__(self) -> None:
        options = self.options
        if options.method == "voxposer":
            options.require_alone()
        if options.num_samples > 1 and (options.closed_loop or options.after is not None):
            raise InvalidInputError("num_samples", f"is {options.num_samples} in a closed loop", "1")
        options.check_other_tasks(self.task)


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        grounded: the instruction as it is understood.
        instructions: to ask for one after the other.
        written: the template at the step that is asked for.
        so_far: the steps of a closed loop that were taken already.
        step: of a closed loop, from 0; None without one.
        observed: the objects as they were found, in the task's order.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        plans: for each of the instructions, the demonstrated rows in the observed scene; None where nobody knows them.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    grounded: Order
    instructions: tuple[str, ...]
    objects: tuple[ObjectPose, ...]
    template: Shown
    written: PromptTemplate | ProgramTemplate
    so_far: str
    step: int | None
    profile: ModelProfile
    style: PromptStyle
    settings: TaskSettings
    observed: tuple[ObjectPose, ...]
    end_effector: Pose | None
    plans: Mapping[str, tuple[PlacedPlan, ...] | None] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    samples: tuple["Question", ...] = ()

    @property
    def start(self) -> EndEffectorAction | None:
        """Where the end effector is at first, if the robot says so and rows may be relative to it."""
        pose = self.end_effector
        if pose is None or not self.style.from_start:
            return None
        return EndEffectorAction(np.array(pose.position_m), np.array(pose.quaternion_xyzw), gripper_open=True)

    def query(self, instruction: str) -> Query:
        """What is asked of the objects as the prompt has them."""
        return Query(instruction, self.objects, start=self.start)

    @property
    def seen(self) -> Query:
        """What is asked of the objects as they were observed."""
        return Query(self.grounded.text, self.observed, start=self.start)

    def without_frames(self) -> "Question":
        """The same once the images have been looked at: decoded, they would fill the memory while the LLM is asked."""
        if not self.request.frames:
            return self
        samples = tuple(sample.without_frames() for sample in self.samples)
        return replace(self, request=self.request.without_frames(), samples=samples)

    @property
    def codec(self) -> Codec:
        """Reads the reply's rows; a reply that is a program has none."""
        assert isinstance(self.written, PromptTemplate)
        return self.written.codec

    @cached_property
    def prompt(self) -> Prompt:
        """The prompt that asks for the first of the instructions."""
        return self.written.ask(self.query(self.instructions[0]), self.request.options.max_actions, self.so_far)


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramQuestion(Question):
    """A question whose answer is a program over value maps instead of rows of actions.

    Attributes:
        scene: what the program is about.
    """

    scene: Scene


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
            "anchor": self._anchor,
        }

    @cached_property
    def _anchor(self) -> JsonObject | None:
        """What the action hangs on, so that a robot that looks again can follow it."""
        if (row := self.row) is None:
            return None
        offset_m, rotation_xyzw = row.seen_from_anchor(self.action)
        return {
            "object": row.anchor.object_name or None,
            "frame": row.anchor.frame,
            "offset_m": offset_m.tolist(),
            "rotation_xyzw": rotation_xyzw.tolist(),
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
