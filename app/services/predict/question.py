"""The question to an LLM: its prompt, the plans that a reply is checked against, and findings before it is asked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Query, start_at
from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.finding import Finding, finding
from app.pipeline.order.order import Order
from app.pipeline.order.reading import read
from app.pipeline.order.taught import taught_words
from app.pipeline.prompt import Prompt
from app.services.measures import timed
from app.services.predict import doubts
from app.services.predict.known import Known, KnownReader
from app.services.predict.placed import Plans, place_plans
from app.services.predict.prefix import Prefix, write_prefix
from app.services.predict.request import PredictRequest
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

MAX_PROMPT_CHARS = 400_000  # of system prompt and demonstrations: 100,000 tokens, which no context here holds


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        request: without decoded images.
        grounded: the instruction as it was parsed.
        seen: the instruction with the observed objects of the task, symmetric ones turned as in demonstrations.
        parts: the queries to ask one after the other, one for a whole instruction or one for each clause; their objects
            have rotations only where the demonstrations have them.
        prompt: of the first part.
        plans: of each part the demonstrated rows, placed in the scene that the parts before leave; None where unknown.
        max_actions: the largest number of actions that the answer may have.
        turned: whether the hand is turned by 180 degrees from what a reply says, in `plans` and in the actions.
        findings: those known before the LLM is asked.
    """

    request: PredictRequest
    known: Known
    grounded: Order
    seen: Query
    parts: tuple[Query, ...]
    prefix: Prefix
    prompt: Prompt
    plans: Plans
    max_actions: int
    turned: bool = False
    findings: tuple[Finding, ...] = ()

    @property
    def as_observed(self) -> tuple[Query, ...]:
        """The parts in the scene as it was observed."""
        return tuple(Query(part.instruction, self.known.observed, start=part.start) for part in self.parts)

    @property
    def deadline_s(self) -> float:
        """The deadline of the answer, from the start of the request to the LLM."""
        return self.request.options.deadline_s(self.known.profile, len(self.prompt.system) + len(self.prompt.user))


def question_of(request: PredictRequest, read: KnownReader) -> Question:
    """Return the question: read the task, choose the demonstrations, parse the instruction, write the prompt.

    Synchronous: call it in a thread.

    Raises:
        as `KnownReader`, `understand`, `write_prefix` and `place_plans`.
        InvalidInputError: if the prompt is too long, or an object lacks a rotation that demonstrations have.
    """
    known = read(request)
    with timed("words"):
        order = understand(request, known, known.instructions)
    start = start_at(request.end_effector)
    with timed("prompt"):
        plans_shown = known.shown.plans_shown(Query(order.text, known.observed, start=start))
        prefix = write_prefix(plans_shown, known.shown_ids, known.task.workspace, known.style)
    template = prefix.template
    _check_length(len(template.system) + len(template.prefix))
    objects, seen = template.posed(known.observed), Query(order.text, known.objects, start=start)
    asked = [Query(part, objects, start=start) for part in template.codec.questions(order)]
    placed = place_plans(known.shown, asked, request.options, known.task, request.end_effector)
    prompt, kept = template.ask(placed.parts[0], placed.max_actions), request.without_frames()
    question = Question(
        kept, known, order, seen, placed.parts, prefix, prompt, placed.plans, placed.max_actions, bool(placed.turned)
    )
    return replace(question, findings=(*doubts_before(question), *placed.turned))


def understand(request: PredictRequest, known: Known, taught: Sequence[str]) -> Order:
    """Return the instruction, parsed against those of the demonstrations that the prompt shows.

    Raises:
        UngroundedInstructionError, UnfamiliarInstructionError: if it is unclear, or may mean an object that is not the
            task's.
    """

    def parsed(objects: Sequence[ObjectPose]) -> Order:
        names, settings = tuple(pose.name for pose in objects), known.task.settings
        aliases = tuple(sorted((name, said) for name, said in settings.aliases.items() if name in names))
        words = taught_words(names, aliases, tuple(dict.fromkeys(taught)))
        layout = settings.layout({pose.name: pose.position_m for pose in objects})
        return read(request.instruction, words, layout, allow_unfamiliar=request.options.unfamiliar == "allow")

    order = parsed(known.objects)
    if known.bystanders and (with_others := parsed((*known.objects, *known.bystanders))).objects != order.objects:
        meant = ", ".join(name for name in with_others.objects if name not in order.objects)
        message = f"may mean {meant}, which demonstrations do not have"
        raise UngroundedInstructionError("instruction", message, ", ".join(pose.name for pose in known.objects))
    return order


def _check_length(num_chars: int) -> None:
    if num_chars > MAX_PROMPT_CHARS:
        valid = f"at most {MAX_PROMPT_CHARS} characters: fewer or shorter demonstrations"
        raise InvalidInputError("num_demonstrations", f"makes a prompt of {num_chars} characters", valid)


def doubts_before(question: Question) -> tuple[Finding, ...]:
    """Return the findings before the LLM is asked: objects, words, demonstrations, scene."""
    known = question.known
    return (
        *doubts.of_objects(known),
        *doubts.of_words(question.grounded, known.instructions),
        *_parts(question),
        *_of_demonstrations(question),
        *known.skills.of_scene(question.as_observed),
    )


def _of_demonstrations(question: Question) -> tuple[Finding, ...]:
    """Return the doubts that uploads and checks have, too, and those that come where nobody tells the hand's start."""
    skills, orders = question.known.skills, [part.order for part in question.parts]
    said = skills.of_orders(orders)
    if question.request.end_effector is not None:
        return said
    codes = {one.code for one in said}
    return (*said, *(one for one in skills.without_start.of_orders(orders) if one.danger and one.code not in codes))


def _parts(question: Question) -> Iterator[Finding]:
    """Report the parts of the instruction that no demonstration shows alone, or in this sequence."""
    for part, plans in zip(question.parts, question.plans, strict=True):
        if plans is None:
            number = len(part.order.clauses)
            message = f"No demonstration carries out {number} part{'s' * (number > 1)} as {part.instruction!r} asks."
            yield finding("new-instruction", 0.0, message, "instruction")
