"""What is known of a request -> the question that is put to an LLM."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.alike import check_named
from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan
from app.services.limits import Limits
from app.services.measures import timed
from app.services.predict.findings import doubts_before
from app.services.predict.instruction import ground_instruction
from app.services.predict.known import Known
from app.services.predict.prefix import Prefix, choose_prefix
from app.services.predict.question import Question
from app.services.predict.request import MAX_ACTIONS_ASKED, PredictRequest
from app.services.predict.turn import Plans, turned_plans
from app.services.predict.within_bounds import require_within_workspace
from app.store.errors import ConflictError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import EndEffectorAction

SEEDS = 2**31  # the most that every backend takes


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
    with timed("prompt"):
        prefix, why = choose_prefix(known.demonstrations, known.scene, known.settings, known.style, chosen=known.chosen)
    with timed("words"):
        grounded = understood(request, instruction, known, prefix.instructions)
        if request.alike:
            check_named(grounded, known.taught.followed(grounded), request.alike)
    step, so_far = _taken(known, prefix)
    template = prefix.at_step(step or 0)
    limits.check_prompt(len(template.system) + len(template.prefix) + len(so_far))
    start = _start(known.end_effector) if known.style.from_start else None
    seen, objects = Query(grounded.text, known.scene.objects, start=start), template.posed(known.scene.objects)
    parts = tuple(Query(part, objects, start=start) for part in template.codec.questions(grounded))
    plans, turned = _plans(request, known, prefix, parts)
    question = Question(
        request=request.without_frames(),
        known=known,
        grounded=grounded,
        seen=seen,
        parts=parts,
        prefix=prefix,
        template=template,
        step=step,
        prompt=template.ask(parts[0], request.options.max_actions, so_far),
        plans=plans,
        turned=bool(turned),
    )
    question = replace(question, findings=(*why, *known.findings, *doubts_before(question), *turned))
    if request.options.num_samples == 1:
        return question
    return replace(question, samples=tuple(_sample(question, k) for k in range(request.options.num_samples)))


def understood(request: PredictRequest, instruction: str, known: Known, taught: Sequence[str]) -> Order:
    """The instruction; a closed loop goes on with what its first step understood.

    The objects move while a closed loop runs: "the leftmost cube" must stay the one that it was.

    Raises:
        as `ground_instruction`.
    """
    if known.previous is not None and known.previous.instruction == request.instruction:
        return known.previous.grounded
    return ground_instruction(request, instruction, taught, known.settings, known.scene)


def _taken(known: Known, prefix: Prefix) -> tuple[int | None, str]:
    """The number of a closed loop's step, and what follows the demonstrations in its prompt: all that was until now.

    Raises:
        ConflictError: if the demonstrations do not read as they did.
    """
    previous, shown = known.previous, prefix.template.prefix
    if previous is None:
        return (0 if known.style.closed_loop else None), ""
    if not previous.prompt_user.startswith(shown):
        raise ConflictError("the demonstrations have changed since the last step: begin the closed loop again")
    codec = prefix.at_step(previous.step).codec
    reply = codec.reply_text(codec.rows(previous.reply_text, complete=True))
    return previous.step + 1, f"{previous.prompt_user[len(shown) :]}{reply}{codec.separator}"


def _plans(
    request: PredictRequest, known: Known, prefix: Prefix, parts: Sequence[Query]
) -> tuple[Plans, list[Finding]]:
    """The demonstrated rows of each part in the observed scene, and why the hand is turned in them, if it is.

    Raises:
        SceneOutOfBoundsError, InvalidInputError: as `write_question`.
    """
    placed = {} if prefix.support is None else {part.instruction: prefix.support.placed(part) for part in parts}
    if request.options.unsupported == "refuse":
        require_within_workspace(placed.values(), known.settings.limits_of_motion())
    plans, turned = turned_plans(placed, known.taught, known.settings, known.end_effector)
    _check_number([plans.get(part.instruction) for part in parts], request.options.max_actions)
    return plans, turned


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


def _sample(question: Question, number: int) -> Question:
    """The question for one of several replies, with a seed of its own."""
    seed = (question.request.options.seed + number) % SEEDS
    return replace(question, request=question.request.with_options(seed=seed))
