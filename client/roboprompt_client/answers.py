"""What the service answers to a prediction, and what a person says of it afterwards."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from roboprompt_client.errors import InvalidAnswerError
from roboprompt_client.motion_guard import action_from_json
from roboprompt_client.reanchoring import ActionAnchor, anchor_from_json
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, object_from_json

SEVERITIES = ("info", "warning", "danger")


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
    def findings(self) -> tuple[Mapping[str, Any], ...]:
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


def findings_in(answer: Mapping[str, Any]) -> tuple[Mapping[str, Any], ...]:
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
