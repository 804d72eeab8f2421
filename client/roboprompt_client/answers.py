"""The service's answer to a prediction: actions and findings; and what a finding of severity `danger` stops."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from roboprompt_client.errors import DangerError, InvalidAnswerError, NotConfirmedError
from roboprompt_client.motion.guard import action_from_json
from roboprompt_client.runs.reanchoring import ActionAnchor, anchor_from_json
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, object_from_json
from roboprompt_client.types.severity import SEVERITIES

Finding = Mapping[str, Any]
Confirm = Callable[[int, EndEffectorAction], bool]
OnDanger = Literal["refuse", "go"] | Callable[[str], bool]
SYMMETRY_SHOWN = "symmetry-shown"
log = logging.getLogger(__name__)


class PlannedStep(NamedTuple):
    """One step of a plan: a task, and the instruction for it."""

    task: str
    instruction: str


class Outcome(NamedTuple):
    """Whether the task was done, and a note on why not."""

    success: bool
    note: str | None = None


@dataclass(frozen=True, eq=False)
class PredictedActions:
    """The service's answer.

    Attributes:
        id: for `RoboPromptClient.record_outcome`.
        response: the whole JSON document: prompt, reply, usage, timings ...
        anchors: for each action the object or frame that it refers to; None where the answer has none.
    """

    id: str
    actions: tuple[EndEffectorAction, ...]
    response: Mapping[str, Any] = field(repr=False)
    anchors: tuple[ActionAnchor | None, ...] = field(default=(), repr=False)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings: `code`, `severity` (info, warning, danger), `message`, `where`; raises as `findings_in`."""
        return findings_in(self.response)

    @property
    def shown_symmetry_deg(self) -> Mapping[str, float]:
        """By object name, the turn after which demonstrations take it alike; the answer counts on it."""
        shown = [finding for finding in self.findings if finding.get("code") == SYMMETRY_SHOWN]
        of_object = [finding for finding in shown if finding["where"].startswith("objects[")]
        return {finding["where"].removeprefix("objects[")[:-1]: float(finding["symmetry_deg"]) for finding in of_object}

    @property
    def objects(self) -> tuple[ObjectPose, ...]:
        """The objects' poses that the prediction used, given or found in images."""
        return tuple(map(object_from_json, self.response.get("objects") or ()))

    @classmethod
    def from_json(cls, answer: Mapping[str, Any]) -> "PredictedActions":
        """Return the answer of `POST /predict`; raises UnsafeActionError for an invalid item of `actions`."""
        actions = tuple(action_from_json(index, item) for index, item in enumerate(answer["actions"]))
        anchors = tuple(anchor_from_json(index, item) for index, item in enumerate(answer["actions"]))
        return cls(answer["id"], actions, answer, anchors)


def findings_in(answer: Mapping[str, Any]) -> tuple[Finding, ...]:
    """Return the findings of an answer or event, each with a severity of `SEVERITIES`.

    Raises:
        InvalidAnswerError: if they are missing, not a list, or a severity is unknown or missing: then it is not known
            whether the service warns of a danger.
    """
    valid = f"a list of objects whose `severity` is {', '.join(SEVERITIES)}"
    if "findings" not in answer:
        raise InvalidAnswerError("findings", "is missing", valid)
    if not isinstance(findings := answer["findings"], list):
        raise InvalidAnswerError("findings", f"is {findings!r:.80}", valid)
    for k, finding in enumerate(findings):
        if not isinstance(finding, Mapping) or finding.get("severity") not in SEVERITIES:
            raise InvalidAnswerError(f"findings[{k}]", f"is {finding!r:.200}", valid)
    return tuple(findings)


def require_allowed(findings: Sequence[Finding], on_danger: OnDanger) -> None:
    """Return if no finding is a danger or each is allowed; every danger is logged as a warning.

    Args:
        findings: as `findings_in` returns them.

    Raises:
        DangerError: if `on_danger` is "refuse".
        NotConfirmedError: if it is a function that returned False for a danger's message; each is asked about once.
    """
    for finding in findings:
        if finding["severity"] != "danger":
            continue
        message = str(finding.get("message", finding.get("code", "")))
        log.warning("danger: %s", message)
        if on_danger == "refuse":
            raise DangerError(f"the prediction is dangerous: {message}")
        if callable(on_danger) and not on_danger(message):
            raise NotConfirmedError(f"the danger was not allowed: {message}")
