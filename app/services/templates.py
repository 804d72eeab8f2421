"""The part of a prompt that does not depend on the query, made once per task version and format."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec, fit_step
from app.pipeline.representation.base import Codec
from app.pipeline.workspace import Workspace
from app.services.task_settings import TaskSettings

CAPACITY = 256  # templates that are kept


@dataclass(frozen=True)
class PromptStyle:
    """How a prompt is written.

    Attributes:
        system_prompt: a variant's name or free text.
        closed_loop: whether observations and actions take turns.
    """

    representation: str
    prompt_format: str
    system_prompt: str
    closed_loop: bool = False


@dataclass(frozen=True)
class TemplateKey:
    """What a template depends on: nothing else may change its bytes."""

    task: str
    version: int
    style: PromptStyle
    demonstration_ids: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Template:
    """A prompt template with what it was made of.

    Attributes:
        cache_key: equal for equal prefixes.
        instructions: of the demonstrations.
    """

    prompt: PromptTemplate | ClosedLoopTemplate
    demonstration_ids: tuple[str, ...]
    cache_key: str
    instructions: tuple[str, ...] = ()

    def at_step(self, step: int) -> PromptTemplate:
        """The template for a step of a closed loop; without one there is only step 0."""
        return self.prompt.at_step(step) if isinstance(self.prompt, ClosedLoopTemplate) else self.prompt


def make_template(demonstrations: Sequence[Demonstration], settings: TaskSettings, style: PromptStyle) -> Template:
    """Fit the representation and write the demonstrations.

    Raises:
        InvalidInputError: without demonstrations; for a closed loop if they did not track their objects.
    """
    canonical = tuple(canonical_demonstration(demonstration, settings) for demonstration in demonstrations)
    prompt = _prompt_template(canonical, settings.workspace.workspace(), style)
    digest = hashlib.sha256(f"{prompt.system}\0{prompt.prefix}".encode()).hexdigest()[:16]
    return Template(prompt, tuple(d.id for d in demonstrations), digest, tuple(d.instruction for d in demonstrations))


def canonical_demonstration(demonstration: Demonstration, settings: TaskSettings) -> Demonstration:
    """The demonstration as prompts show it: symmetric objects at their canonical yaw."""
    later = tuple(settings.canonical(objects) for objects in demonstration.later_objects)
    return replace(demonstration, objects=settings.canonical(demonstration.objects), later_objects=later)


def _prompt_template(
    demonstrations: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> PromptTemplate | ClosedLoopTemplate:
    system = system_prompt_text(style.system_prompt)
    names = (style.representation, style.prompt_format)
    if not style.closed_loop:
        return PromptTemplate.write(fit_codec(*names, demonstrations, workspace), demonstrations, system)

    def fit(shown: Sequence[Demonstration], step: int) -> Codec:
        return fit_step(*names, shown, workspace, step)

    return ClosedLoopTemplate.write(fit, demonstrations, system)
