"""What an LLM reads before the query, made once for each version of a task and style of prompt: the demonstrations."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.plans import by_plan
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec
from app.pipeline.representation.base import Codec
from app.pipeline.workspace import Workspace
from app.services.predict.request import PromptStyle
from roboprompt_client.errors import InvalidInputError


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


def make_prefix(
    shown: Sequence[Demonstration], recorded: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> Prefix:
    """Fit the representation and write the demonstrations.

    Args:
        shown: as the prompt shows them.
        recorded: the same before rows of one plan were made to agree.

    Raises:
        InvalidInputError: without demonstrations; for a closed loop if they did not track their objects.
    """
    if not style.from_start:
        shown, recorded = (tuple(replace(item, start=None) for item in items) for items in (shown, recorded))
    return Prefix(
        _template(shown, workspace, style),
        tuple(item.id for item in shown),
        None if style.closed_loop else Support.of(by_plan(recorded), by_plan(shown)),
        tuple(item.instruction for item in shown),
    )


def _template(
    demonstrations: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> PromptTemplate | ClosedLoopTemplate:
    system = system_prompt_text(style.system_prompt)
    names = (style.representation, style.prompt_format)
    if not style.closed_loop:
        return PromptTemplate.write(fit_codec(*names, demonstrations, workspace), demonstrations, system)
    if style.representation == "parts":
        raise InvalidInputError("representation", "is 'parts' in a closed loop", "one that writes single actions")

    def fit(shown: Sequence[Demonstration], step: int) -> Codec:
        return fit_codec(*names, shown, workspace, first_row=step + 1)

    return ClosedLoopTemplate.write(fit, demonstrations, system)
