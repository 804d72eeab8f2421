"""The request of a robot with its options; an option that is left out follows the task, then the model."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.perception.images import ImageBytes
from app.perception.object_model import WHOLE, Number, Truth
from app.pipeline.representation.base import usual_format
from app.services.task_settings import PromptFormat, Representation, SystemPrompt, TaskSettings
from app.store.values import JsonObject
from roboprompt_client.motion.limits import MAX_ACTIONS
from roboprompt_client.types.arrays import settle
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.names import checked_instruction
from roboprompt_client.types.poses import Pose

Selection = Literal["first", "recent", "random", "nearest"]
MAX_TIMEOUT_S = 600.0  # `roboprompt_client` waits as long
Doubtful = Literal["refuse", "allow"]


class PredictOptions(BaseModel):
    """How to predict."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    num_demonstrations: Annotated[int | None, Field(ge=1, le=100), WHOLE] = None
    selection: Annotated[
        Selection,
        Field(description="first and recent by time of upload; nearest: to the observed objects, the nearest last"),
    ] = "first"
    seed: Annotated[int, Field(ge=0, le=2**31 - 1, description="for selection random and for sampling"), WHOLE] = 0
    temperature: Annotated[Number, Field(ge=0, le=2, description="0: the most probable reply")] = 0.0
    episode_ids: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, max_length=100, description="exactly these demonstrations, in this order"),
    ] = None
    model: Annotated[str | None, Field(max_length=200, description="a name from GET /models")] = None
    representation: Representation | None = None
    prompt_format: PromptFormat | None = None
    system_prompt: Annotated[SystemPrompt | None, Field(description="a, b, c, none or free text")] = None
    unfamiliar: Annotated[
        Doubtful,
        Field(
            description="an instruction unlike every taught one: refuse, or pass it on to the LLM with a finding of "
            "severity danger; objects that are not clear are refused either way"
        ),
    ] = "refuse"
    max_actions: Annotated[
        int | None,
        Field(ge=1, le=MAX_ACTIONS, description="left out: as many as the demonstrated plans need, 25 at least"),
        WHOLE,
    ] = None
    timeout_s: Annotated[
        Number | None, Field(ge=0.1, le=MAX_TIMEOUT_S, description="default: the model's, see GET /models")
    ] = None
    unsupported: Annotated[
        Doubtful,
        Field(description="allow: actions unlike what was demonstrated are answered with a finding instead of refused"),
    ] = "refuse"
    stream_text: Annotated[
        Truth,
        Field(
            description="with `Accept: text/event-stream`: the reply's text, too, in events `text`; before it events "
            "`progress`, of models that tell how much of the prompt they have read"
        ),
    ] = False

    def deadline_s(self, profile: ModelProfile, prompt_chars: int = 0) -> float:
        """How long the answer may take: as asked for, else what the model needs, for a prompt that it has not read."""
        needed_s = profile.timeout_s + profile.reading_s * prompt_chars / 1000
        return min(needed_s, MAX_TIMEOUT_S) if self.timeout_s is None else self.timeout_s


@dataclass(frozen=True)
class PredictRequest:
    """The request of a robot.

    Attributes:
        objects: the observed objects, in any order.
        frames: calibrated images, for estimators that look.
        cameras: those of the frames, where these are no longer kept.
        images: the same as they came, by camera, to be stored with the prediction.
        end_effector: where the robot's end effector is, where it is known.
        as_sent: the request as it came, to be stored with the prediction.

    Raises:
        InvalidInputError: for an instruction that cannot be part of a prompt.
    """

    task: str
    instruction: str
    objects: tuple[ObjectQuery, ...]
    frames: tuple[RgbdFrame, ...] = ()
    cameras: tuple[Camera, ...] = ()
    images: Mapping[str, ImageBytes] = field(default_factory=dict)
    end_effector: Pose | None = None
    options: PredictOptions = PredictOptions()  # noqa: RUF009  it is frozen
    as_sent: JsonObject = field(default_factory=dict)

    def __post_init__(self) -> None:
        settle(self, instruction=checked_instruction("instruction", self.instruction))

    def without_frames(self) -> "PredictRequest":
        """The same with the cameras, but without what was decoded: it would fill the memory while the LLM is asked."""
        return replace(self, cameras=tuple(frame.camera for frame in self.frames) or self.cameras, frames=())


class PromptStyle(NamedTuple):
    """How a prompt is written.

    Attributes:
        system_prompt: a variant's name or free text.
        from_start: whether the robot says where its end effector is, so that rows may be relative to that.
    """

    representation: str
    prompt_format: str
    system_prompt: str
    from_start: bool = False

    @classmethod
    def of(
        cls, options: PredictOptions, settings: TaskSettings, profile: ModelProfile, *, from_start: bool = False
    ) -> "PromptStyle":
        """The style that a request asks for; what it leaves out is the task's, then the model's."""
        representation = options.representation or settings.representation or profile.representation
        asked = options.prompt_format or settings.prompt_format
        prompt_format = asked or usual_format(representation, profile.prompt_format)
        system_prompt = options.system_prompt or settings.system_prompt
        if system_prompt is None:  # the one that describes the prompt: the paper's are about lists of actions
            lists = profile.style == "chat" and representation not in ("object_frame", "parts")
            system_prompt = profile.system_prompt if lists else "none"
        return cls(representation, prompt_format, system_prompt, from_start)
