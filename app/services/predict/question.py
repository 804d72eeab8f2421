"""The question that is put to an LLM: what is known of a request, and the prompt that was written of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.llm.base import ModelProfile
from app.pipeline.findings import Finding
from app.pipeline.language.grounded import Grounded
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.prompt import Prompt, PromptTemplate
from app.services.limits import Limits
from app.services.measures import timed
from app.services.predict.findings import findings_before
from app.services.predict.instruction import ground_instruction
from app.services.predict.known import Known
from app.services.predict.prefix import Prefix, PromptStyle
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

SEEDS = 2**31  # the most that every backend takes


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        request: without what was decoded.
        settings: of the task.
        profile: of the model that is asked.
        observed: the objects as they were found, in the task's order.
        objects: the same as the prompt has them, with rotations where demonstrations have them.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        start: the same where rows may be relative to it.
        prefix: what the LLM reads before the query.
        template: writes the query and reads the reply, at the step that is asked for.
        grounded: the instruction as it is understood.
        instructions: to ask for one after the other.
        so_far: the steps of a closed loop that were taken already.
        step: of a closed loop, from 0; None without one.
        prompt: asks for the first of the instructions.
        plans: for each of the instructions, the demonstrated rows in the observed scene; None where they are unknown.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    settings: TaskSettings
    profile: ModelProfile
    style: PromptStyle
    observed: tuple[ObjectPose, ...]
    objects: tuple[ObjectPose, ...]
    end_effector: Pose | None
    start: EndEffectorAction | None
    prefix: Prefix
    template: PromptTemplate
    grounded: Grounded
    instructions: tuple[str, ...]
    so_far: str
    step: int | None
    prompt: Prompt
    plans: Mapping[str, tuple[PlacedPlan, ...] | None]
    findings: tuple[Finding, ...]
    samples: tuple["Question", ...] = ()


def write_question(request: PredictRequest, instruction: str, known: Known, limits: Limits) -> Question:
    """The question that `request` puts to its model.

    Args:
        instruction: the request's, checked.

    Raises:
        UngroundedInstructionError, UnfamiliarInstructionError: if the instruction is not clear.
        ConflictError: if a closed loop's demonstrations have changed since its last step.
        InvalidInputError: if the prompt is too long, or an object lacks a rotation that demonstrations have.
    """
    prefix, style, previous, observed = known.prefixes[0], known.style, known.previous, known.objects
    with timed("words"):
        grounded = ground_instruction(request, instruction, prefix.instructions, known.settings, observed, previous)
    step = None if not style.closed_loop else 0 if previous is None else previous.step + 1
    template = prefix.at_step(step or 0).in_scene(observed)
    so_far = "" if previous is None else previous.so_far(prefix)
    limits.check_prompt(len(template.system) + len(template.prefix) + len(so_far))
    instructions = template.codec.questions(grounded.instruction)
    objects = template.posed(observed)
    start = _start(known.end_effector) if style.from_start else None
    support = prefix.support
    plans = {} if support is None else {part: support.placed(objects, part, start) for part in instructions}
    placed = [plan for found in plans.values() for plan in found or ()]
    question = Question(
        request=request.without_frames(),
        settings=known.settings,
        profile=known.profile,
        style=style,
        observed=observed,
        objects=objects,
        end_effector=known.end_effector,
        start=start,
        prefix=prefix,
        template=template,
        grounded=grounded,
        instructions=instructions,
        so_far=so_far,
        step=step,
        prompt=template.ask(objects, instructions[0], request.options.max_actions, so_far),
        plans=plans,
        findings=findings_before(prefix, grounded, observed, placed),
    )
    if request.options.num_samples == 1:
        return question
    own = known.prefixes if len(known.prefixes) > 1 else [prefix] * request.options.num_samples
    return replace(question, samples=tuple(_sample(question, k, shown) for k, shown in enumerate(own)))


def _start(end_effector: Pose | None) -> EndEffectorAction | None:
    if end_effector is None:
        return None
    return EndEffectorAction(np.array(end_effector.position_m), np.array(end_effector.quaternion_xyzw), True)


def _sample(question: Question, number: int, prefix: Prefix) -> Question:
    """The question for one of several replies: with a seed of its own, and demonstrations in an order of its own."""
    options = question.request.options
    template = prefix.at_step(0).in_scene(question.objects)
    return replace(
        question,
        request=question.request.with_options(seed=(options.seed + number) % SEEDS),
        prefix=prefix,
        template=template,
        prompt=template.ask(question.objects, question.instructions[0], options.max_actions, question.so_far),
    )
