"""The question that is put to an LLM, with what is doubtful before it is asked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.pipeline.alike import alike_findings
from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.findings.arrangement import changed_places
from app.pipeline.findings.rules import NEW_INSTRUCTION, NEW_ROLE, PARTS_NOT_SHOWN, UNFAMILIAR_INSTRUCTION
from app.pipeline.findings.scatter import not_shown_findings
from app.pipeline.findings.scene import other_objects, scene_findings, strangers
from app.pipeline.findings.sources import source_findings
from app.pipeline.findings.start import frame_findings, start_findings
from app.pipeline.order.order import Order
from app.pipeline.prompt import Prompt, PromptTemplate
from app.services.limits import Limits
from app.services.predict.known import Known
from app.services.predict.placed import Plans, place_plans
from app.services.predict.prefix import Prefix
from app.services.predict.request import PredictRequest
from roboprompt_client.types.poses import EndEffectorAction, Pose

SEEDS = 2**31  # the most that every backend takes
LISTED = 3  # instructions that a sentence names


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        request: without what was decoded.
        grounded: the instruction as it is understood.
        seen: the same of the task's objects as they were found, in the task's order.
        parts: what is asked for one after the other, of the objects as the prompt has them: with rotations where
            demonstrations have them.
        prefix: what the LLM reads before the query.
        template: writes the query and reads the reply, at the step that is asked for.
        prompt: asks for the first of the parts.
        plans: by instruction of a part, the demonstrated rows in the observed scene; None where they are unknown.
        turned: whether actions have the hand turned by half a turn from what a reply says, as `plans` have.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    known: Known
    grounded: Order
    seen: Query
    parts: tuple[Query, ...]
    prefix: Prefix
    template: PromptTemplate
    prompt: Prompt
    plans: Plans
    turned: bool = False
    findings: tuple[Finding, ...] = ()
    samples: tuple["Question", ...] = ()

    @property
    def deadline_s(self) -> float:
        """How long the answer may take."""
        return self.request.options.deadline_s(self.known.profile, len(self.prompt.system) + len(self.prompt.user))


def write_question(
    request: PredictRequest, known: Known, prefix: Prefix, why: Sequence[Finding], order: Order, limits: Limits
) -> Question:
    """The question that `request` puts to its model.

    Args:
        why: the prefix is shown.
        order: the instruction as it is understood.

    Raises:
        SceneOutOfBoundsError: if every demonstrated plan leaves the workspace here.
        ConflictError: if a closed loop's demonstrations have changed since its last step.
        InvalidInputError: if the prompt is too long, an object lacks a rotation that demonstrations have, or the parts
            of the instruction take more actions than the request allows.
    """
    so_far = "" if known.previous is None else prefix.taken(known.previous)
    template = prefix.at_step(known.step or 0)
    limits.check_prompt(len(template.system) + len(template.prefix) + len(so_far))
    start = _start(known.end_effector) if known.style.from_start else None
    seen, objects = Query(order.text, known.scene.objects, start=start), template.posed(known.scene.objects)
    parts = tuple(Query(part, objects, start=start) for part in template.codec.questions(order))
    plans, turned = place_plans(known, prefix, parts, request.options)
    prompt = template.ask(parts[0], request.options.max_actions, so_far)
    request = request.without_frames()
    question = Question(request, known, order, seen, parts, prefix, template, prompt, plans, turned=bool(turned))
    question = replace(question, findings=(*why, *doubts_before(question), *turned))
    if request.options.num_samples == 1:
        return question
    return replace(question, samples=tuple(_sample(question, k) for k in range(request.options.num_samples)))


def _start(end_effector: Pose | None) -> EndEffectorAction | None:
    if end_effector is None:
        return None
    return EndEffectorAction(np.array(end_effector.position_m), np.array(end_effector.quaternion_xyzw), True)


def _sample(question: Question, number: int) -> Question:
    """The question for one of several replies, with a seed of its own."""
    seed = (question.request.options.seed + number) % SEEDS
    return replace(question, request=question.request.with_options(seed=seed))


def doubts_before(question: Question) -> Iterator[Finding]:
    """What deserves a look before the LLM is asked, causes first: the objects, the words, demonstrations and scene."""
    known, order, seen = question.known, question.grounded, question.seen
    scene, taught = known.scene, known.taught
    followed = taught.followed(order)
    yield from other_objects(scene.absent, [pose.name for pose in scene.bystanders])
    if known.previous is not None:
        yield from changed_places(known.previous.objects, scene.objects)
    yield from alike_findings(question.request.alike)
    yield from _words(order, question.prefix.instructions)
    yield from _parts(question)
    that_matter = tuple(pose for pose in seen.objects if pose.name in followed or not followed)
    yield from source_findings(that_matter, taught.demonstrations, taught.compared)
    yield from taught.findings(order)
    if len(question.prefix.demonstration_ids) < len(taught.demonstrations):
        yield from not_shown_findings(question.prefix.support, taught.support, order)
    yield from scene_findings(seen, taught.scenes, followed, taught.needed)
    now = known.end_effector if known.previous is None else None
    if taught.follows_start(order):
        yield from start_findings(now, taught.scenes)
    yield from frame_findings(now, taught.demonstrations, taught.hands)


def _words(order: Order, shown: Sequence[str]) -> Iterator[Finding]:
    taught = tuple(dict.fromkeys(shown))
    if order.unfamiliar is not None:
        message = f"{order.unfamiliar}; it was passed on to the LLM."
        yield UNFAMILIAR_INSTRUCTION.finding(message, "instruction")
    elif taught and order.text not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {order.text!r}; they have {listed}."
        yield NEW_INSTRUCTION.finding(message, "instruction")
        yield from _new_roles(order, taught)


def _new_roles(order: Order, taught: Sequence[str]) -> Iterator[Finding]:
    for stranger in strangers(order, taught):
        shown = ", ".join(map(repr, stranger.instead_of[:LISTED]))
        message = (
            f"{stranger.name!r} stands where demonstrations have {shown}, another kind of thing: the motion is theirs."
        )
        yield NEW_ROLE.finding(message, "instruction", value=float(stranger.named_elsewhere))


def _parts(question: Question) -> Iterator[Finding]:
    """The parts of the instruction that no demonstration shows alone, or strung together like this."""
    for part in question.parts:
        if part.instruction in question.plans and question.plans[part.instruction] is None:
            number = len(part.order.clauses)
            message = f"No demonstration carries out {number} part{'s' * (number > 1)} as {part.instruction!r} asks."
            yield PARTS_NOT_SHOWN.finding(message, "instruction")
