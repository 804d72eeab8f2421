"""What the service answers, as a robot needs it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import httpx

from roboprompt_client.motion_guard import action_from_json
from roboprompt_client.reanchoring import ActionAnchor, anchor_from_json
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose


@dataclass(frozen=True, eq=False)
class PredictedActions:
    """The service's answer.

    Attributes:
        id: for `record_outcome`.
        response: the whole document: prompt, reply, usage, timings.
        anchors: what each action hangs on; None where the service does not say.
    """

    id: str
    actions: tuple[EndEffectorAction, ...]
    response: Mapping[str, Any]
    anchors: tuple[ActionAnchor | None, ...] = ()

    @property
    def findings(self) -> tuple[Mapping[str, Any], ...]:
        """What deserves a look: `code`, `severity` (info, warning, danger), `message`, `where`."""
        return tuple(self.response.get("findings") or ())

    @property
    def grounding(self) -> tuple[Mapping[str, Any], ...]:
        """Which words of the instruction mean which object; empty where the service does not say."""
        return tuple(self.response.get("grounding") or ())

    @property
    def objects(self) -> tuple[ObjectPose, ...]:
        """The poses that the service went by, given or found in images."""
        items = self.response.get("objects") or ()
        return tuple(ObjectPose(item["name"], item["position"], item.get("quaternion_xyzw")) for item in items)

    @classmethod
    def from_json(cls, answer: Mapping[str, Any]) -> "PredictedActions":
        """The answer of `POST /predict`; raises UnsafeActionError where an action is none."""
        actions = tuple(action_from_json(index, item) for index, item in enumerate(answer["actions"]))
        anchors = tuple(anchor_from_json(index, item) for index, item in enumerate(answer["actions"]))
        return cls(answer["id"], actions, answer, anchors)


def problem_of(response: httpx.Response) -> dict[str, Any]:
    """The problem document of an error; made of its text where it has none."""
    try:
        document = response.json()
    except ValueError:
        document = None
    return document if isinstance(document, dict) else {"title": response.reason_phrase, "detail": response.text[:500]}
