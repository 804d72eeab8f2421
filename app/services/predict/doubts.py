"""What is doubtful about a prediction, causes first: its words, scene, demonstrations, reply and actions.

This is the one list that answers, stored predictions, pages and reports show. The actions of a reply are compared with
what its demonstrations support.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding, Severity
from app.pipeline.findings.actions import ActionDoubt, scatter_findings
from app.pipeline.findings.scene import scene_findings, strangers
from app.pipeline.plans.support import PlacedRow, SupportGuard
from app.pipeline.workspace import ROTATION_BIN_DEG
from app.services.predict.question import Question
from app.store.records import PredictionStatus
from roboprompt_client.trajectory import EndEffectorAction

LISTED = 3  # instructions that a sentence names
FAILURES: Mapping[PredictionStatus, tuple[str, str, str]] = {
    "parse_error": ("unparsable-reply", "reply", "The reply is not a list of valid actions"),
    "unsafe_action": ("unsafe-action", "actions", "An action breaks a bound of motion"),
    "unsupported": ("unsupported-action", "actions", "The demonstrations do not support an action"),
    "model_error": ("model-failed", "reply", "The LLM did not answer"),
}
# What bins alone may do: half a bin where a demonstration was written, half where the reply is read; of rotations,
# three Euler angles together.
TOLERATED_BINS = 1.0
TOLERATED_DEG = 1.5 * ROTATION_BIN_DEG


class Answered(Protocol):
    """What an LLM has answered so far."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in it deserves a look."""
        ...


def findings_before(question: Question) -> tuple[Finding, ...]:
    """What deserves a look before the LLM is asked, causes first."""
    plans = [plan for placed in question.plans.values() for plan in placed or ()]
    scene = scene_findings(question.seen, question.template.scenes)
    return (*_other_tasks(question), *_words(question), *scene, *scatter_findings(plans))


def findings_of(
    question: Question, answered: Answered, status: PredictionStatus, error: str | None = None
) -> tuple[Finding, ...]:
    """All that deserves a look in a prediction.

    Args:
        error: why there are no actions, unless the status is `ok`.
    """
    return (*question.findings, *answered.findings, *_failure(status, error))


def _other_tasks(question: Question) -> Iterator[Finding]:
    if others := question.template.other_tasks:
        listed = ", ".join(f"{name} ({number})" for name, number in others)
        message = (
            f"Nobody has shown this task: the prompt has demonstrations of {listed}, with objects of their own. No"
            " demonstrated plan holds the actions, only the bounds of motion do."
        )
        yield Finding("other-tasks-demonstrations", "danger", message)


def _words(question: Question) -> Iterator[Finding]:
    grounded, taught = question.grounded, tuple(dict.fromkeys(question.template.instructions))
    if grounded.unfamiliar is not None:
        message = f"{grounded.unfamiliar}; it was passed on to the LLM."
        yield Finding("unfamiliar-instruction", "danger", message, "instruction")
    elif taught and grounded.text not in taught:
        more = f" and {len(taught) - LISTED} more" if taught[LISTED:] else ""
        listed = ", ".join(map(repr, taught[:LISTED])) + more
        message = f"No demonstration has this instruction, {grounded.text!r}; they have {listed}."
        yield Finding("new-instruction", "info", message, "instruction")
        yield from _new_roles(question, taught)


def _new_roles(question: Question, taught: Sequence[str]) -> Iterator[Finding]:
    for stranger in strangers(question.grounded, taught):
        shown = ", ".join(map(repr, stranger.instead_of[:LISTED]))
        severity: Severity = "danger" if stranger.named_elsewhere else "warning"
        message = (
            f"{stranger.name!r} stands where demonstrations have {shown}, another kind of thing: the motion is theirs."
        )
        yield Finding("new-role", severity, message, "instruction")


def _failure(status: PredictionStatus, error: str | None) -> Iterator[Finding]:
    if status != "ok":
        code, where, what = FAILURES[status]
        yield Finding(code, "danger", f"{what}: {error}. The robot got no actions.", where)


class SupportCheck:
    """Checks actions as they come.

    Attributes:
        doubts: about actions that the request lets pass, and about those that lie beyond every demonstration.

    Args:
        num_before: actions of replies to earlier parts of the instruction.
    """

    def __init__(self, question: Question, instruction: str, num_before: int = 0) -> None:
        plans = question.plans.get(instruction)
        self._guard = SupportGuard(plans, num_before) if plans else None
        self._allows = question.request.options.unsupported == "allow"
        self._tolerated_m = TOLERATED_BINS * float(question.settings.workspace.workspace().bin_size_m.max())
        self._index = num_before
        self.doubts: list[ActionDoubt] = []

    def check(self, actions: Sequence[EndEffectorAction]) -> list[PlacedRow | None]:
        """Let the next actions pass; the demonstrated row that each carries out, None where none is known.

        Raises:
            UnsupportedActionError: unless the request lets it pass.
        """
        return [self._row(action) for action in actions]

    def _row(self, action: EndEffectorAction) -> PlacedRow | None:
        index, self._index = self._index, self._index + 1
        if self._guard is None:
            return None
        try:
            row = self._guard.check(action)
        except UnsupportedActionError as error:
            self._let_pass(error, index)
            self._guard.pass_by()
            return None
        self._doubt(index, row, action)
        return row

    def _doubt(self, index: int, row: PlacedRow, action: EndEffectorAction) -> None:
        beyond_m, beyond_deg = row.beyond(action)
        if beyond_m > self._tolerated_m or beyond_deg > TOLERATED_DEG:
            seen_from = row.anchor.object_name or f"the {row.anchor.frame}"
            self.doubts.append(ActionDoubt(index, beyond_m, beyond_deg, seen_from))

    def finish(self) -> None:
        """Let the reply end; raises as `check`."""
        try:
            if self._guard is not None:
                self._guard.finish()
        except UnsupportedActionError as error:
            self._let_pass(error, self._index)

    def _let_pass(self, error: UnsupportedActionError, index: int) -> None:
        if not self._allows:
            raise error
        self.doubts.append(ActionDoubt(index, unsupported=error))
