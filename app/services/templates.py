"""The part of a prompt that does not depend on the query, made once per task version and format."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.plans import by_plan
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec, fit_step
from app.pipeline.representation.base import Codec
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.workspace import Workspace
from app.services.demonstrations import Demonstrations
from app.services.task_settings import TaskSettings

CAPACITY = 256  # templates that are kept


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


@dataclass(frozen=True)
class TemplateKey:
    """What a template depends on: nothing else may change its bytes."""

    task: str
    version: int
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    all_of_them: bool = False


@dataclass(frozen=True, eq=False)
class Template:
    """A prompt template with what it was made of.

    Attributes:
        support: what the demonstrations support; None for the steps of a closed loop.
        cache_key: equal for equal prefixes.
        instructions: of the demonstrations.
    """

    prompt: PromptTemplate | ClosedLoopTemplate
    support: Support | None
    demonstration_ids: tuple[str, ...]
    cache_key: str
    instructions: tuple[str, ...] = ()

    def at_step(self, step: int) -> PromptTemplate:
        """The template for a step of a closed loop; without one there is only step 0."""
        return self.prompt.at_step(step) if isinstance(self.prompt, ClosedLoopTemplate) else self.prompt


def make_template(demonstrations: Demonstrations, settings: TaskSettings, style: PromptStyle) -> Template:
    """Fit the representation and write the demonstrations.

    Raises:
        InvalidInputError: without demonstrations; for a closed loop if they did not track their objects.
    """
    shown, recorded = demonstrations.shown, demonstrations.recorded
    if not style.from_start:
        shown, recorded = (tuple(replace(item, start=None) for item in items) for items in (shown, recorded))
    prompt = _prompt_template(shown, settings.workspace.workspace(), style)
    digest = hashlib.sha256(f"{prompt.system}\0{prompt.prefix}".encode()).hexdigest()[:16]
    support = None if style.closed_loop else Support.of(by_plan(recorded))
    instructions = tuple(d.instruction for d in shown)
    return Template(prompt, support, tuple(d.id for d in shown), digest, instructions)


def _prompt_template(
    demonstrations: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> PromptTemplate | ClosedLoopTemplate:
    system = system_prompt_text(style.system_prompt)
    names = (style.representation, style.prompt_format)
    if not style.closed_loop:
        codec = fit_codec(*names, demonstrations, workspace)
        written = codec.telling() if isinstance(codec, ObjectFrameCodec) else demonstrations
        return PromptTemplate.write(codec, demonstrations, system, written)

    def fit(shown: Sequence[Demonstration], step: int) -> Codec:
        return fit_step(*names, shown, workspace, step)

    return ClosedLoopTemplate.write(fit, demonstrations, system)
