"""What the service answers to a prediction: actions, findings, events; and whether a danger among them may pass."""

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
from roboprompt_client.http.connection import event_document
from roboprompt_client.motion.guard import action_from_json
from roboprompt_client.runs.reanchoring import ActionAnchor, anchor_from_json
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, object_from_json

Finding = Mapping[str, Any]
OnFindings = Callable[[Sequence[Finding]], None]
Confirm = Callable[[int, EndEffectorAction], bool]
OnDanger = Literal["confirm", "refuse", "go"]
SEVERITIES = ("info", "warning", "danger")
log = logging.getLogger(__name__)


class PlannedStep(NamedTuple):
    """What a task is to do, in its own words."""

    task: str
    instruction: str


class Outcome(NamedTuple):
    """How the robot fared with a prediction: whether the task was done, and in words why not."""

    success: bool
    note: str | None = None


@dataclass(frozen=True, eq=False)
class PredictedActions:
    """The service's answer.

    Attributes:
        id: for `RoboPromptClient.record_outcome`.
        response: the whole document: prompt, reply, usage, timings.
        anchors: the object or frame that each action refers to; None where the service does not say.
    """

    id: str
    actions: tuple[EndEffectorAction, ...]
    response: Mapping[str, Any]
    anchors: tuple[ActionAnchor | None, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The service's doubts: `code`, `severity` (info, warning, danger), `message`, `where`; see `findings_in`."""
        return findings_in(self.response)

    @property
    def grounding(self) -> tuple[Mapping[str, Any], ...]:
        """Which words of the instruction mean which object; empty where the service does not say."""
        return tuple(self.response.get("grounding") or ())

    @property
    def objects(self) -> tuple[ObjectPose, ...]:
        """The poses that the prediction is for, given or found in images: with estimator, confidence and reason."""
        return tuple(map(object_from_json, self.response.get("objects") or ()))

    @classmethod
    def from_json(cls, answer: Mapping[str, Any]) -> "PredictedActions":
        """The answer of `POST /predict`; raises UnsafeActionError for an item of `actions` that is no action."""
        actions = tuple(action_from_json(index, item) for index, item in enumerate(answer["actions"]))
        anchors = tuple(anchor_from_json(index, item) for index, item in enumerate(answer["actions"]))
        return cls(answer["id"], actions, answer, anchors)


class StreamReader:
    """What the events of a prediction say, one after the other.

    Args:
        on_findings: called with what the service doubts beforehand, ahead of the first action.
    """

    def __init__(self, on_findings: OnFindings | None) -> None:
        self._on_findings, self._index = on_findings, 0

    def read(self, event: ServerSentEvent, response: httpx.Response) -> EndEffectorAction | PredictedActions | None:
        """An action, the whole answer, which is the last one, or nothing to hand on.

        Raises:
            ServiceProblemError: for an event that says so.
            ServiceUnreachableError, InvalidAnswerError, UnsafeActionError: for data, findings and actions that are not
                well formed.
        """
        if not event.data:  # then it is no event (HTML standard, 9.2.6)
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


def findings_in(answer: Mapping[str, Any]) -> tuple[Finding, ...]:
    """The findings of an answer or event, all of which have one of `SEVERITIES`.

    Raises:
        InvalidAnswerError: if they are missing, no list, or one of them has another severity or none: whether the
            service warns of a danger is then not known.
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
    """The setting; None becomes `confirm` where a person can be asked, else `refuse`.

    Raises:
        InvalidInputError: if there is no such setting, or no `confirm` to ask.
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
    """Let a prediction pass that has no danger among its findings, or whose dangers a person allows.

    Every danger is logged as a warning; `confirm` is asked once for each, with the action that it is about, else with
    the first.

    Args:
        findings: well-formed, as `findings_in` returns them.

    Raises:
        DangerError: if `on_danger` refuses it.
        NotConfirmedError: if `confirm` said no.
    """
    dangers = [finding for finding in findings if finding["severity"] == "danger"]
    for finding in dangers if actions else ():
        message = str(finding.get("message", finding.get("code", "")))
        log.warning("danger: %s", message)
        if on_danger == "refuse":
            raise DangerError(f"the prediction is dangerous: {message}")
        named = re.fullmatch(r"actions\[(\d+)\].*", str(finding.get("where", "")))
        index = min(int(named[1]), len(actions) - 1) if named else 0  # the first where it is about the scene
        if on_danger == "confirm" and confirm is not None and not confirm(index, actions[index]):
            raise NotConfirmedError(f"action {index + 1} was not allowed: {message}")
