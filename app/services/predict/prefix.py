"""Demonstrations -> the text before the query of a prompt, written once."""

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache

from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.shown import shown_of
from app.pipeline.skill.skills import Skills
from app.pipeline.workspace import Workspace
from app.services.predict.request import PromptStyle
from app.services.predict.scenes import Ids
from app.services.task_settings import TaskSettings

MAX_PREFIXES = 256
MAX_WARMED = 4  # plans whose prompts a model reads ahead


@dataclass(frozen=True, eq=False)
class Prefix:
    """The system prompt and the demonstrations as text.

    Attributes:
        template: has the text, and writes queries.
        demonstration_ids: in the order of the prompt.
    """

    template: PromptTemplate
    demonstration_ids: tuple[str, ...]

    @cached_property
    def cache_key(self) -> str:
        """A digest of the prompt up to the query."""
        return hashlib.sha256(f"{self.template.system}\0{self.template.prefix}".encode()).hexdigest()[:16]


def usual_prefixes(skills: Skills, ids: Ids, settings: TaskSettings, style: PromptStyle) -> list[Prefix]:
    """Return the prefixes of the most frequent plans, the most frequent first."""
    workspace, usual = settings.workspace.workspace(), skills.plans_shown(None)
    first = skills.of_form(skills.forms[0])
    others = tuple(plan for plan in usual if plan not in first.plans)
    choices = [(plan, *others) for plan in first.usual[:MAX_WARMED]] if first.aligned else [usual]
    return [write_prefix(plans, ids, workspace, style) for plans in choices]


@lru_cache(MAX_PREFIXES)
def write_prefix(plans: tuple[Plan, ...], ids: Ids, workspace: Workspace, style: PromptStyle) -> Prefix:
    """Write the demonstrations of plans. The text depends on the arguments alone, byte for byte.

    Args:
        ids: of demonstrations, in the order of the prompt.

    Raises:
        InvalidInputError: without demonstrations.
    """
    every = {item.demonstration.id: item for plan in plans for item in shown_of(plan)}
    shown = [every[id_] for id_ in ids if id_ in every]
    codec = fit_codec(style.representation, style.prompt_format, shown, workspace)
    demonstrations = [item.demonstration for item in shown]
    return Prefix(
        PromptTemplate.write(codec, demonstrations, system_prompt_text(style.system_prompt)),
        tuple(item.id for item in demonstrations),
    )
