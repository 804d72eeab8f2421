"""What an LLM reads before the query, made once for each version of a task and style of prompt: the demonstrations."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from app.llm.base import ModelProfile
from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.plans import by_plan
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import KAT_FORMAT, fit_codec
from app.pipeline.representation.base import Codec
from app.pipeline.workspace import Workspace
from app.services.predict.request import PredictRequest
from app.services.predict.select import Demonstrations
from app.services.task_settings import TaskSettings


@dataclass(frozen=True)
class PromptStyle:
    """How a prompt is written.

    Attributes:
        system_prompt: a variant's name or free text.
        closed_loop: whether observations and actions take turns.
        from_start: whether the robot says where its end effector is, so that rows may be relative to that.
    """

    representation: str
    prompt_format: str
    system_prompt: str
    closed_loop: bool = False
    from_start: bool = False

    @classmethod
    def of(cls, request: PredictRequest, settings: TaskSettings, profile: ModelProfile) -> "PromptStyle":
        """What the request says, else the task's setting, else what suits the model."""
        options = request.options
        representation = options.representation or settings.representation or profile.representation
        prompt_format = options.prompt_format or settings.prompt_format or profile.prompt_format
        system_prompt = options.system_prompt or settings.system_prompt
        if system_prompt is None:  # the one that describes the prompt: the paper's are about lists of actions
            lists = profile.style == "chat" and representation != "object_frame"
            system_prompt = "none" if not lists else "kat" if prompt_format == KAT_FORMAT else profile.system_prompt
        started = request.end_effector is not None and not options.closed_loop
        return cls(representation, prompt_format, system_prompt, options.closed_loop, started)


@dataclass(frozen=True)
class PrefixKey:
    """What a prefix depends on: nothing else may change its bytes.

    Attributes:
        all_of_them: also demonstrations of a rare plan.
        shown_ids: of the demonstrations whose plan the scene calls for; empty where no scene is asked.
        absent: objects of the task that the scene does not have.
    """

    task: str
    version: int
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    all_of_them: bool = False
    shown_ids: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Prefix:
    """The system prompt and the demonstrations, written, with what the demonstrations say of a reply.

    Attributes:
        template: writes the query after them; of a closed loop, for every step.
        demonstration_ids: in the order in which they are shown.
        support: what the demonstrations support; None for the steps of a closed loop.
        instructions: of the demonstrations.
    """

    template: PromptTemplate | ClosedLoopTemplate
    demonstration_ids: tuple[str, ...]
    support: Support | None = None
    instructions: tuple[str, ...] = ()

    @cached_property
    def cache_key(self) -> str:
        """Equal for equal prompts up to the query."""
        return hashlib.sha256(f"{self.template.system}\0{self.template.prefix}".encode()).hexdigest()[:16]

    def at_step(self, step: int) -> PromptTemplate:
        """The template for a step of a closed loop; without one there is only step 0."""
        return self.template.at_step(step) if isinstance(self.template, ClosedLoopTemplate) else self.template


def make_prefix(demonstrations: Demonstrations, settings: TaskSettings, style: PromptStyle) -> Prefix:
    """Fit the representation and write the demonstrations.

    Raises:
        InvalidInputError: without demonstrations; for a closed loop if they did not track their objects.
    """
    shown, recorded = demonstrations.shown, demonstrations.recorded
    if not style.from_start:
        shown, recorded = (tuple(replace(item, start=None) for item in items) for items in (shown, recorded))
    return Prefix(
        _template(shown, settings.workspace.workspace(), style),
        tuple(item.id for item in shown),
        None if style.closed_loop else Support.of(by_plan(recorded)),
        tuple(item.instruction for item in shown),
    )


def _template(
    demonstrations: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> PromptTemplate | ClosedLoopTemplate:
    system = system_prompt_text(style.system_prompt)
    names = (style.representation, style.prompt_format)
    if not style.closed_loop:
        return PromptTemplate.write(fit_codec(*names, demonstrations, workspace), demonstrations, system)

    def fit(shown: Sequence[Demonstration], step: int) -> Codec:
        return fit_codec(*names, shown, workspace, first_row=step + 1)

    return ClosedLoopTemplate.write(fit, demonstrations, system)
