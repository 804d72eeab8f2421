"""The part of a prompt that does not depend on the query, made once per task version and format.

In a closed loop the step before is part of it: the next prompt goes on from that step's prompt and reply.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sqlalchemy import Connection

from app.pipeline.closed_loop import ClosedLoopTemplate
from app.pipeline.episode import Demonstration
from app.pipeline.findings.actions import ShownWays
from app.pipeline.findings.places import ShownScenes
from app.pipeline.order.order import Order
from app.pipeline.plans import by_plan
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec, fit_other_tasks
from app.pipeline.representation.base import Codec
from app.pipeline.workspace import Workspace
from app.services.predict.select import Demonstrations
from app.services.task_settings import TaskSettings
from app.store import predictions
from app.store.errors import ConflictError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose

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
    """What a template depends on: nothing else may change its bytes.

    Attributes:
        other_tasks: whose demonstrations it has instead of the task's own, with their versions.
    """

    task: str
    version: int
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    all_of_them: bool = False
    other_tasks: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Shown:
    """What a prompt shows before its query.

    Attributes:
        cache_key: equal for equal prefixes.
        demonstration_ids: of the demonstrations; none where a prompt shows none.
        support: what the demonstrations support; None for the steps of a closed loop, and without demonstrations of
            the task that is asked for.
        instructions: of the demonstrations, where they show that task.
        other_tasks: where they show others, these with the numbers of demonstrations.
    """

    cache_key: str
    demonstration_ids: tuple[str, ...] = ()
    support: Support | None = None
    instructions: tuple[str, ...] = ()
    other_tasks: tuple[tuple[str, int], ...] = ()

    @cached_property
    def scenes(self) -> ShownScenes:
        """The scenes of the demonstrations that support a reply."""
        return ShownScenes(self._supporting)

    @cached_property
    def ways(self) -> ShownWays:
        """The ways of the same demonstrations."""
        return ShownWays(self._supporting)

    @property
    def _supporting(self) -> tuple[Demonstration, ...]:
        plans = () if self.support is None else self.support.plans
        return tuple(demonstration for group, _ in plans for demonstration in group)


@dataclass(frozen=True, eq=False, kw_only=True)
class Template(Shown):
    """A prompt template with what it was made of."""

    prompt: PromptTemplate | ClosedLoopTemplate

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
    support = None if style.closed_loop else Support.of(by_plan(recorded))
    instructions = tuple(d.instruction for d in shown)
    ids = tuple(d.id for d in shown)
    return Template(
        cache_key=cache_key_of(prompt.system, prompt.prefix),
        demonstration_ids=ids,
        support=support,
        instructions=instructions,
        prompt=prompt,
    )


def cache_key_of(system: str, prefix: str) -> str:
    """Equal for equal prompts up to the query."""
    return hashlib.sha256(f"{system}\0{prefix}".encode()).hexdigest()[:16]


def make_other_tasks_template(
    tasks: Mapping[str, Sequence[Demonstration]], ids: Sequence[str], settings: TaskSettings, style: PromptStyle
) -> Template:
    """The same of other tasks' demonstrations, which nothing is held to.

    Args:
        tasks: by name what a prompt shows of each.
        ids: in the order in which they are shown.
        settings: of the task that is asked for.
    """
    groups = [tuple(item if style.from_start else replace(item, start=None) for item in tasks[name]) for name in tasks]
    codec = fit_other_tasks(style.representation, style.prompt_format, groups, settings.workspace.workspace())
    shown = sorted((item for group in groups for item in group), key=lambda item: ids.index(item.id))
    prompt = PromptTemplate.write(codec, shown, system_prompt_text(style.system_prompt), of_other_tasks=True)
    numbers = tuple((name, len(tasks[name])) for name in tasks)
    return Template(
        cache_key=cache_key_of(prompt.system, prompt.prefix),
        demonstration_ids=tuple(item.id for item in shown),
        other_tasks=numbers,
        prompt=prompt,
    )


def _prompt_template(
    demonstrations: Sequence[Demonstration], workspace: Workspace, style: PromptStyle
) -> PromptTemplate | ClosedLoopTemplate:
    system = system_prompt_text(style.system_prompt)
    names = (style.representation, style.prompt_format)
    if not style.closed_loop:
        return PromptTemplate.write(fit_codec(*names, demonstrations, workspace), demonstrations, system)

    def fit(shown: Sequence[Demonstration], step: int) -> Codec:
        return fit_codec(*names, shown, workspace, first_row=step + 1)

    return ClosedLoopTemplate.write(fit, demonstrations, system)


@dataclass(frozen=True)
class PreviousStep:
    """A closed loop's last prediction.

    Attributes:
        step: its number, from 0.
        prompt_user, reply_text: as the LLM read and wrote them.
        end_effector: where its action sent it.
        instruction, grounded: as it was asked, and how it was understood, where that was kept.
    """

    step: int
    model: str
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    prompt_user: str
    reply_text: str
    end_effector: Pose
    instruction: str
    grounded: Order | None

    def so_far(self, template: Template) -> str:
        """What follows the demonstrations in the next prompt: every observation and action until now.

        Raises:
            ConflictError: if the demonstrations do not read as they did.
        """
        prefix = template.prompt.prefix
        if not self.prompt_user.startswith(prefix):
            raise ConflictError("the demonstrations have changed since the last step: begin the closed loop again")
        codec = template.at_step(self.step).codec
        reply = codec.reply_text(codec.rows(self.reply_text, complete=True))
        return f"{self.prompt_user[len(prefix) :]}{reply}{codec.separator}"


def previous_step(connection: Connection, prediction_id: str, task: str) -> PreviousStep:
    """The prediction that a closed loop goes on from.

    Raises:
        NotFoundError: if there is no such prediction.
        InvalidInputError: if it is none that a closed loop of this task can go on from.
    """
    record = predictions.get(connection, prediction_id)
    valid = "the id of the last step of a closed loop that goes on"
    if record.task != task:
        raise InvalidInputError("after", f"is a prediction of the task {record.task!r}", valid)
    if record.step is None or record.reply_text is None or record.actions is None:
        raise InvalidInputError("after", "is not a step of a closed loop that gave an action", valid)
    if not record.actions:
        raise InvalidInputError("after", "is a step that ended its closed loop", valid)
    style = PromptStyle(record.representation, record.prompt_format, record.prompt_system, closed_loop=True)
    last = record.actions[-1]
    return PreviousStep(
        record.step,
        record.model,
        style,
        record.demonstration_ids,
        record.prompt_user,
        record.reply_text,
        Pose(tuple(last["position"]), tuple(last["quaternion_xyzw"])),
        record.instruction,
        None if record.grounding is None else Order.from_json(record.grounding, [item.name for item in record.objects]),
    )
