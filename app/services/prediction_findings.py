"""What is doubtful about a prediction, causes first: its words, scene, demonstrations, reply and actions.

The one list that answers, stored predictions, pages and reports show.
"""

from collections.abc import Iterator, Mapping
from typing import Protocol

from app.pipeline.demonstration_findings import scatter_findings
from app.pipeline.findings import Finding
from app.pipeline.scene_findings import scene_findings
from app.services.question import Question
from app.store.records import PredictionStatus

LISTED = 3  # instructions that a sentence names
FAILURES: Mapping[PredictionStatus, tuple[str, str, str]] = {
    "parse_error": ("unparsable-reply", "reply", "The reply is not a list of valid actions"),
    "unsafe_action": ("unsafe-action", "actions", "An action breaks a bound of motion"),
    "unsupported": ("unsupported-action", "actions", "The demonstrations do not support an action"),
    "model_error": ("model-failed", "reply", "The LLM did not answer"),
}


class Answered(Protocol):
    """What an LLM has answered so far."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in it deserves a look."""
        ...


def findings_before(question: Question) -> tuple[Finding, ...]:
    """What deserves a look before the LLM is asked, causes first."""
    support = question.template.support
    shown = [] if support is None else [demonstration for group, _ in support.plans for demonstration in group]
    plans = [plan for placed in question.plans.values() for plan in placed or ()]
    scene = scene_findings(question.observed, shown, question.grounded.instruction)
    return (*_words(question), *scene, *scatter_findings(plans))


def findings_of(
    question: Question, answered: Answered, status: PredictionStatus, error: str | None = None
) -> tuple[Finding, ...]:
    """All that deserves a look in a prediction.

    Args:
        error: why there are no actions, unless the status is `ok`.
    """
    return (*question.findings, *answered.findings, *_failure(status, error))


def _words(question: Question) -> Iterator[Finding]:
    grounded, taught = question.grounded, tuple(dict.fromkeys(question.template.instructions))
    if grounded.unfamiliar is not None:
        message = f"{grounded.unfamiliar}; it was passed on to the LLM."
        yield Finding("unfamiliar-instruction", "danger", message, "instruction")
    elif taught and grounded.instruction not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {grounded.instruction!r}; they have {listed}."
        yield Finding("new-instruction", "info", message, "instruction")


def _failure(status: PredictionStatus, error: str | None) -> Iterator[Finding]:
    if status != "ok":
        code, where, what = FAILURES[status]
        yield Finding(code, "danger", f"{what}: {error}. The robot got no actions.", where)
