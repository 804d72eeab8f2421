"""The question to an LLM: its prompt, the plans that a reply is checked against, and findings before it is asked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Query, start_at
from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.findings import Finding
from app.pipeline.findings.frames import frame_findings, held_findings, source_findings, start_findings
from app.pipeline.findings.roles import strangers
from app.pipeline.findings.rules import NEW_INSTRUCTION, NEW_ROLE, PARTS_NOT_SHOWN, UNFAMILIAR_INSTRUCTION
from app.pipeline.findings.scene import other_objects, scene_findings
from app.pipeline.order.order import Order
from app.pipeline.order.reading import read
from app.pipeline.order.taught import taught_words
from app.pipeline.plans.symmetry import symmetry_findings
from app.pipeline.prompt import Prompt
from app.services.measures import timed
from app.services.predict.known import Known, KnownReader
from app.services.predict.placed import Plans, place_plans
from app.services.predict.prefix import Prefix, write_prefix
from app.services.predict.request import PredictRequest
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

MAX_PROMPT_CHARS = 400_000  # of system prompt and demonstrations: 100,000 tokens, which no context here holds
LISTED = 3  # instructions that a sentence names


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
        plans: by a part's instruction, the demonstrated rows placed in the observed scene; None where unknown.
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
    def deadline_s(self) -> float:
        """The deadline of the answer, from the start of the request to the LLM."""
        return self.request.options.deadline_s(self.known.profile, len(self.prompt.system) + len(self.prompt.user))


def question_of(request: PredictRequest, read: KnownReader) -> Question:
    """Return the question: read the task, choose the demonstrations, parse the instruction, write the prompt.

    Synchronous: call it in a thread.

    Raises:
        as `KnownReader`, `write_prefix`, `understand` and `place_plans`.
        InvalidInputError: if the prompt is too long, or an object lacks a rotation that demonstrations have.
    """
    known = read(request)
    with timed("prompt"):
        prefix, why = choose_prefix(request, known)
    with timed("words"):
        order = understand(request, known, prefix.instructions)
    template, hand = prefix.template, request.end_effector
    _check_length(len(template.system) + len(template.prefix))
    start = start_at(hand)
    seen, objects = Query(order.text, known.objects, start=start), template.posed(known.objects)
    parts = tuple(Query(part, objects, start=start) for part in template.codec.questions(order))
    plans, turned, max_actions = place_plans(prefix.support, parts, request.options, known.task, known.taught, hand)
    prompt, kept = template.ask(parts[0], max_actions), request.without_frames()
    question = Question(kept, known, order, seen, parts, prefix, prompt, plans, max_actions, turned=bool(turned))
    return replace(question, findings=(*why, *doubts_before(question), *turned))


def choose_prefix(request: PredictRequest, known: Known) -> tuple[Prefix, tuple[Finding, ...]]:
    """Return the prefix for this scene, and findings that say why its demonstrations were chosen.

    Of several plans it has those that the scene calls for; of demonstrations that the request names, all.
    """
    plans = known.demonstrations.plans
    named = request.options.episode_ids is not None
    choice = None if named or plans is None else plans(known.objects)
    shown, findings = (None, ()) if choice is None else (choice.shown, choice.findings)
    return write_prefix(known.demonstrations, known.task.workspace, known.style, shown, known.absent), findings


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


def doubts_before(question: Question) -> Iterator[Finding]:
    """Yield the findings before the LLM is asked, causes first: objects, words, demonstrations, scene."""
    known, order, seen, hand = question.known, question.grounded, question.seen, question.request.end_effector
    taught = known.taught
    followed = taught.followed(order)
    yield from other_objects(known.absent, [pose.name for pose in known.bystanders])
    yield from symmetry_findings(known.task.symmetries or {})
    yield from _words(order, question.prefix.instructions)
    yield from _parts(question)
    that_matter = tuple(pose for pose in seen.objects if pose.name in followed or not followed)
    yield from source_findings(that_matter, taught.demonstrations, taught.compared)
    yield from taught.findings(order)
    yield from taught.of_prompt(question.parts, question.plans, question.prefix.demonstration_ids)
    yield from scene_findings(seen, taught.scenes, followed, taught.turning(order), taught.needed)
    if taught.follows_start(order):
        yield from start_findings(hand, taught.scenes)
    yield from frame_findings(hand, taught.demonstrations, taught.hands)
    yield from held_findings(hand, seen, taught.demonstrations, taught.hands)


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
    """Report the parts of the instruction that no demonstration shows alone, or in this sequence."""
    for part in question.parts:
        if part.instruction in question.plans and question.plans[part.instruction] is None:
            number = len(part.order.clauses)
            message = f"No demonstration carries out {number} part{'s' * (number > 1)} as {part.instruction!r} asks."
            yield PARTS_NOT_SHOWN.finding(message, "instruction")
