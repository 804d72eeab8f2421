"""What is doubtful about a prediction before its LLM is asked, causes first: its demonstrations, words and scene.

With what a reply adds, this is the one list that answers, stored predictions, pages and reports show.
"""

from collections.abc import Iterator, Mapping, Sequence

from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import (
    MODEL_FAILED,
    NEW_INSTRUCTION,
    NEW_ROLE,
    PARTS_NOT_SHOWN,
    UNFAMILIAR_INSTRUCTION,
    UNPARSABLE,
    UNSAFE,
    UNSUPPORTED,
    Rule,
)
from app.pipeline.findings.scatter import not_shown_findings
from app.pipeline.findings.scene import scene_findings, strangers
from app.pipeline.findings.sources import source_findings
from app.pipeline.findings.start import frame_findings, start_findings
from app.pipeline.order.order import Order
from app.services.predict.question import Question
from app.store.records import PredictionStatus
from roboprompt_client.trajectory import ObjectPose

LISTED = 3  # instructions that a sentence names
FAILURES: Mapping[PredictionStatus, tuple[Rule, str, str]] = {
    "parse_error": (UNPARSABLE, "reply", "The reply is not a list of valid actions"),
    "unsafe_action": (UNSAFE, "actions", "An action breaks a bound of motion"),
    "unsupported": (UNSUPPORTED, "actions", "The demonstrations do not support an action"),
    "model_error": (MODEL_FAILED, "reply", "The LLM did not answer"),
}


def doubts_before(question: Question) -> Iterator[Finding]:
    """What deserves a look before the LLM is asked, causes first."""
    known, order, seen = question.known, question.grounded, question.seen
    taught, now = known.taught, known.end_effector if known.previous is None else None
    followed = taught.followed(order)
    yield from _words(order, question.prefix.instructions)
    yield from _parts(question)
    yield from source_findings(_that_matter(seen, followed), taught.demonstrations, taught.compared)
    yield from taught.findings(order)
    if len(question.prefix.demonstration_ids) < len(taught.demonstrations):
        yield from not_shown_findings(question.prefix.support, taught.support, order)
    yield from scene_findings(seen, taught.scenes, followed, taught.needed)
    if taught.follows_start(order):
        yield from start_findings(now, taught.scenes)
    yield from frame_findings(now, taught.demonstrations, taught.hands)


def _that_matter(seen: Query, followed: frozenset[str]) -> tuple[ObjectPose, ...]:
    """The objects that the motion follows; all where that is not known."""
    return tuple(pose for pose in seen.objects if pose.name in followed or not followed)


def failure_findings(status: PredictionStatus, error: str | None) -> tuple[Finding, ...]:
    """Why there are no actions; nothing for the status `ok`."""
    if status == "ok":
        return ()
    rule, where, what = FAILURES[status]
    return (rule.finding(f"{what}: {error}. The robot got no actions.", where),)


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


def _parts(question: Question) -> Iterator[Finding]:
    """The parts of the instruction that no demonstration shows alone, or strung together like this."""
    for part in question.parts:
        if part.instruction in question.plans and question.plans[part.instruction] is None:
            number = len(part.order.clauses)
            message = f"No demonstration carries out {number} part{'s' * (number > 1)} as {part.instruction!r} asks."
            yield PARTS_NOT_SHOWN.finding(message, "instruction")


def _new_roles(order: Order, taught: Sequence[str]) -> Iterator[Finding]:
    for stranger in strangers(order, taught):
        shown = ", ".join(map(repr, stranger.instead_of[:LISTED]))
        message = (
            f"{stranger.name!r} stands where demonstrations have {shown}, another kind of thing: the motion is theirs."
        )
        yield NEW_ROLE.finding(message, "instruction", value=float(stranger.named_elsewhere))
