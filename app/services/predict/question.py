"""The question that is put to an LLM: what is known of a request, and the prompt that was written of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.llm.base import ModelProfile
from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.scene import other_objects
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.prompt import Prompt, PromptTemplate
from app.services.limits import Limits
from app.services.measures import timed
from app.services.predict.findings import findings_before
from app.services.predict.instruction import ground_instruction
from app.services.predict.known import Known
from app.services.predict.prefix import Prefix, PromptStyle
from app.services.predict.request import MAX_ACTIONS_ASKED, PredictRequest
from app.services.predict.within_bounds import require_within_workspace
from app.services.task_settings import TaskSettings
from roboprompt_client.errors import InvalidInputError
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
        grounded: the instruction as it is understood.
        seen: the same of the task's objects as they were found, in the task's order.
        bystanders: other objects, which the hand must not hit.
        parts: what is asked for one after the other, of the objects as the prompt has them: with rotations where
            demonstrations have them.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        prefix: what the LLM reads before the query.
        taught: what the answer is held against.
        template: writes the query and reads the reply, at the step that is asked for.
        so_far: the steps of a closed loop that were taken already.
        step: of a closed loop, from 0; None without one.
        prompt: asks for the first of the parts.
        plans: by instruction of a part, the demonstrated rows in the observed scene; None where they are unknown.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    settings: TaskSettings
    profile: ModelProfile
    style: PromptStyle
    grounded: Order
    seen: Query
    bystanders: tuple[ObjectPose, ...]
    parts: tuple[Query, ...]
    end_effector: Pose | None
    prefix: Prefix
    taught: Taught
    template: PromptTemplate
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
        SceneOutOfBoundsError: if every demonstrated plan leaves the workspace here.
        ConflictError: if a closed loop's demonstrations have changed since its last step.
        InvalidInputError: if the prompt is too long, an object lacks a rotation that demonstrations have, or the parts
            of the instruction take more actions than the request allows.
    """
    prefix, style, previous, scene = known.prefixes[0], known.style, known.previous, known.scene
    observed = scene.objects
    with timed("words"):
        grounded = ground_instruction(request, instruction, prefix.instructions, known.settings, scene, previous)
    step = None if not style.closed_loop else 0 if previous is None else previous.step + 1
    template = prefix.at_step(step or 0)
    so_far = "" if previous is None else previous.so_far(prefix)
    limits.check_prompt(len(template.system) + len(template.prefix) + len(so_far))
    start = _start(known.end_effector) if style.from_start else None
    seen, objects, support = Query(grounded.text, observed, start=start), template.posed(observed), prefix.support
    parts = tuple(Query(part, objects, start=start) for part in template.codec.questions(grounded))
    plans = {} if support is None else {part.instruction: support.placed(part) for part in parts}
    if request.options.unsupported == "refuse":
        require_within_workspace(plans.values(), known.settings.limits_of_motion())
    _check_number([plans.get(part.instruction) for part in parts], request.options.max_actions)
    question = Question(
        request=request.without_frames(),
        settings=known.settings,
        profile=known.profile,
        style=style,
        grounded=grounded,
        seen=seen,
        bystanders=scene.bystanders,
        parts=parts,
        end_effector=known.end_effector,
        prefix=prefix,
        taught=known.taught,
        template=template,
        so_far=so_far,
        step=step,
        prompt=template.ask(parts[0], request.options.max_actions, so_far),
        plans=plans,
        findings=(
            *known.plan_findings,
            *other_objects(scene.absent, [pose.name for pose in scene.bystanders]),
            *findings_before(prefix, known.taught, seen, grounded),
        ),
    )
    if request.options.num_samples == 1:
        return question
    own = known.prefixes if len(known.prefixes) > 1 else [prefix] * request.options.num_samples
    return replace(question, samples=tuple(_sample(question, k, shown) for k, shown in enumerate(own)))


def _check_number(placed: Sequence[tuple[PlacedPlan, ...] | None], most: int) -> None:
    """Refuse several parts whose shortest plans have more actions than `most`, before an LLM writes them in vain."""
    fewest = sum(min(map(len, plans), default=1) if plans else 1 for plans in placed)
    if len(placed) > 1 and fewest > most:
        message = f"is {most}, but the {len(placed)} parts of the instruction take {fewest} actions or more"
        raise InvalidInputError("max_actions", message, f"{fewest} or more, at most {MAX_ACTIONS_ASKED}")


def _start(end_effector: Pose | None) -> EndEffectorAction | None:
    if end_effector is None:
        return None
    return EndEffectorAction(np.array(end_effector.position_m), np.array(end_effector.quaternion_xyzw), True)


def _sample(question: Question, number: int, prefix: Prefix) -> Question:
    """The question for one of several replies: with a seed of its own, and demonstrations in an order of its own."""
    options = question.request.options
    template = prefix.at_step(0)
    return replace(
        question,
        request=question.request.with_options(seed=(options.seed + number) % SEEDS),
        prefix=prefix,
        template=template,
        prompt=template.ask(question.parts[0], options.max_actions, question.so_far),
    )
