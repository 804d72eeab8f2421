"""What is doubtful about a prediction before its LLM is asked, causes first: its demonstrations, words and scene.

With what a reply adds, this is the one list that answers, stored predictions, pages and reports show.
"""

from collections.abc import Iterator, Mapping, Sequence

from app.pipeline.episode import Query
from app.pipeline.findings import Finding, Severity
from app.pipeline.findings.actions import scatter_findings
from app.pipeline.findings.scene import scene_findings, strangers
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan
from app.services.predict.prefix import Prefix
from app.store.records import PredictionStatus

LISTED = 3  # instructions that a sentence names
FAILURES: Mapping[PredictionStatus, tuple[str, str, str]] = {
    "parse_error": ("unparsable-reply", "reply", "The reply is not a list of valid actions"),
    "unsafe_action": ("unsafe-action", "actions", "An action breaks a bound of motion"),
    "unsupported": ("unsupported-action", "actions", "The demonstrations do not support an action"),
    "model_error": ("model-failed", "reply", "The LLM did not answer"),
}


def findings_before(prefix: Prefix, seen: Query, order: Order, plans: Sequence[PlacedPlan]) -> tuple[Finding, ...]:
    """What deserves a look before the LLM is asked, causes first.

    Args:
        seen: what is asked of the objects as they were observed.
        order: the instruction as it is understood.
        plans: the demonstrated rows in their scene.
    """
    scene = scene_findings(seen, prefix.scenes)
    return (*_other_tasks(prefix), *_words(order, prefix), *scene, *scatter_findings(plans))


def failure_findings(status: PredictionStatus, error: str | None) -> tuple[Finding, ...]:
    """Why there are no actions; nothing for the status `ok`."""
    if status == "ok":
        return ()
    code, where, what = FAILURES[status]
    return (Finding(code, "danger", f"{what}: {error}. The robot got no actions.", where),)


def _other_tasks(prefix: Prefix) -> Iterator[Finding]:
    if others := prefix.other_tasks:
        listed = ", ".join(f"{name} ({number})" for name, number in others)
        message = (
            f"Nobody has shown this task: the prompt has demonstrations of {listed}, with objects of their own. No"
            " demonstrated plan holds the actions, only the bounds of motion do."
        )
        yield Finding("other-tasks-demonstrations", "danger", message)


def _words(order: Order, prefix: Prefix) -> Iterator[Finding]:
    taught = tuple(dict.fromkeys(prefix.instructions))
    if order.unfamiliar is not None:
        message = f"{order.unfamiliar}; it was passed on to the LLM."
        yield Finding("unfamiliar-instruction", "danger", message, "instruction")
    elif taught and order.text not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {order.text!r}; they have {listed}."
        yield Finding("new-instruction", "info", message, "instruction")
        yield from _new_roles(order, taught)


def _new_roles(order: Order, taught: Sequence[str]) -> Iterator[Finding]:
    for stranger in strangers(order, taught):
        shown = ", ".join(map(repr, stranger.instead_of[:LISTED]))
        severity: Severity = "danger" if stranger.named_elsewhere else "warning"
        message = (
            f"{stranger.name!r} stands where demonstrations have {shown}, another kind of thing: the motion is theirs."
        )
        yield Finding("new-role", severity, message, "instruction")
