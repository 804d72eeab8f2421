"""Demonstrations -> the text before the query of a prompt, with what replies are checked against."""

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from app.pipeline.episode import Demonstration
from app.pipeline.groups import by_plan
from app.pipeline.plans import agreeing
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec
from app.pipeline.workspace import Workspace
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.request import PromptStyle
from app.services.task_settings import TaskSettings

MAX_PREFIXES = 256


@dataclass(frozen=True, eq=False)
class Prefix:
    """The system prompt and the demonstrations as text, with what replies are checked against.

    Attributes:
        template: has the text, and writes queries.
        demonstration_ids: in the order of the prompt.
        support: checks actions against the demonstrated plans.
        instructions: of the demonstrations.
    """

    template: PromptTemplate
    demonstration_ids: tuple[str, ...]
    support: Support
    instructions: tuple[str, ...]

    @cached_property
    def cache_key(self) -> str:
        """A digest of the prompt up to the query."""
        return hashlib.sha256(f"{self.template.system}\0{self.template.prefix}".encode()).hexdigest()[:16]


def usual_prefixes(demonstrations: Demonstrations, settings: TaskSettings, style: PromptStyle) -> list[Prefix]:
    """Return the prefixes of the most frequent plans, the most frequent first."""
    workspace, plans = settings.workspace.workspace(), demonstrations.plans
    choices = [None] if plans is None else [choice.shown for choice in plans.likely()]
    return [write_prefix(demonstrations, workspace, style, shown) for shown in choices]


@lru_cache(MAX_PREFIXES)
def write_prefix(
    demonstrations: Demonstrations,
    workspace: Workspace,
    style: PromptStyle,
    of_scene: tuple[Demonstration, ...] | None,
    absent: tuple[str, ...] = (),
) -> Prefix:
    """Fit the representation and write the demonstrations. The text depends on the arguments alone, byte for byte.

    Args:
        of_scene: the recorded demonstrations of the plans that the scene calls for; None: all.
        absent: objects of the task that the scene lacks.

    Raises:
        InvalidInputError: without demonstrations.
    """
    recorded = demonstrations.recorded if of_scene is None else of_scene
    shown = demonstrations.shown if of_scene is None else agreeing(of_scene)
    shown, recorded = (
        tuple(_as_asked(item, absent, style.from_start) for item in items) for items in (shown, recorded)
    )
    codec = fit_codec(style.representation, style.prompt_format, shown, workspace)
    return Prefix(
        PromptTemplate.write(codec, shown, system_prompt_text(style.system_prompt)),
        tuple(item.id for item in shown),
        Support.of(by_plan(recorded), by_plan(shown)),
        tuple(item.instruction for item in shown),
    )


def _as_asked(demonstration: Demonstration, absent: Collection[str], from_start: bool) -> Demonstration:
    """Return the demonstration without absent objects, and without the start pose if the request has none."""
    present = demonstration.only([pose.name for pose in demonstration.objects if pose.name not in absent])
    return present if from_start else replace(present, start=None)
