"""The service's answer to a prediction: actions, findings, events; and what a finding of severity `danger` stops."""

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, get_args

import httpx
from httpx_sse import ServerSentEvent

from roboprompt_client.errors import (
    DangerError,
    InvalidAnswerError,
    InvalidInputError,
    NotConfirmedError,
    ServiceProblemError,
)
from roboprompt_client.http import event_document
from roboprompt_client.motion.guard import action_from_json
from roboprompt_client.runs.reanchoring import ActionAnchor, anchor_from_json
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, object_from_json
from roboprompt_client.types.severity import SEVERITIES

Finding = Mapping[str, Any]
OnFindings = Callable[[Sequence[Finding]], None]
Confirm = Callable[[int, EndEffectorAction], bool]
OnDanger = Literal["confirm", "refuse", "go"]
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
        return {finding["where"].removeprefix("objects[")[:-1]: float(finding["symmetry_deg"]) for finding in shown}

    @property
    def grounding(self) -> tuple[Mapping[str, Any], ...]:
        """Which words of the instruction name which object."""
        return tuple(self.response.get("grounding") or ())

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


class StreamReader:
    """Reads the events of a streamed prediction one after the other.

    Args:
        on_findings: called with the findings that come before the first action.
    """

    def __init__(self, on_findings: OnFindings | None) -> None:
        self._on_findings, self._index = on_findings, 0

    def read(self, event: ServerSentEvent, response: httpx.Response) -> EndEffectorAction | PredictedActions | None:
        """Return an action, the whole answer (which comes last), or None for other events.

        Raises:
            ServiceProblemError: for an event `error`.
            ServiceUnreachableError, InvalidAnswerError, UnsafeActionError: for malformed data, findings or actions.
        """
        if not event.data:  # an event without data is none (HTML standard, 9.2.6)
            return None
        name, document = event.event, event_document(event, response)
        if name == "findings" and self._on_findings is not None:
            self._on_findings(findings_in(document))
        if name == "action":
            self._index += 1
            return action_from_json(self._index - 1, document)
        if name == "done":
            return PredictedActions.from_json(document)
        if name == "error":
            raise ServiceProblemError(document.get("status", 502), document)
        return None


def planned_steps(answer: Mapping[str, Any]) -> tuple[PlannedStep, ...]:
    """Return the steps of the answer of `POST /plans`."""
    return tuple(PlannedStep(step["task"], step["instruction"]) for step in answer["steps"])


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


def checked_on_danger(on_danger: OnDanger | None, confirm: Confirm | None) -> OnDanger:
    """Return the setting; None becomes "confirm" where there is a `confirm` to ask, else "refuse".

    Raises:
        InvalidInputError: for an unknown setting, or "confirm" without a `confirm` to ask.
    """
    if on_danger is None:
        return "refuse" if confirm is None else "confirm"
    if on_danger not in get_args(OnDanger):
        raise InvalidInputError("on_danger", f"is {on_danger!r:.40}", ", ".join(get_args(OnDanger)))
    if on_danger == "confirm" and confirm is None:
        raise InvalidInputError("on_danger", "is 'confirm', but there is no `confirm` to ask", "refuse, go")
    return on_danger


def require_allowed(
    findings: Sequence[Finding], actions: Sequence[EndEffectorAction], on_danger: OnDanger, confirm: Confirm | None
) -> None:
    """Return if no finding is a danger or each is allowed, else raise.

    Every danger is logged as a warning. `confirm` is asked once for each, with the action that the finding names, else
    with the first action.

    Args:
        findings: as `findings_in` returns them.

    Raises:
        DangerError: if `on_danger` is "refuse".
        NotConfirmedError: if `confirm` returned False.
    """
    dangers = [finding for finding in findings if finding["severity"] == "danger"]
    for finding in dangers if actions else ():
        message = str(finding.get("message", finding.get("code", "")))
        log.warning("danger: %s", message)
        if on_danger == "refuse":
            raise DangerError(f"the prediction is dangerous: {message}")
        named = re.fullmatch(r"actions\[(\d+)\].*", str(finding.get("where", "")))
        index = min(int(named[1]), len(actions) - 1) if named else 0  # a finding about the scene names no action
        if on_danger == "confirm" and confirm is not None and not confirm(index, actions[index]):
            raise NotConfirmedError(f"action {index + 1} was not allowed: {message}")
