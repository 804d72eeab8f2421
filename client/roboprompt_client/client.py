"""The service as a robot sees it."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from roboprompt_client.answers import PlannedStep, PredictedActions, findings_in
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.encoding import prediction_request
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError
from roboprompt_client.motion_guard import action_from_json
from roboprompt_client.robot import Observation
from roboprompt_client.service import DEFAULT_URL
from roboprompt_client.teaching import Teaching
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, object_from_json, object_json

__all__ = ["DEFAULT_URL", "RoboPromptClient"]
LONGEST_S = 600.0  # that the service gives a model where a request names no deadline
MARGIN_S = 10.0  # the service answers within the request's own deadline; this is for the way there and back


class RoboPromptClient(Teaching):
    """Uploads demonstrations and asks for actions. Use it as a context manager, or call `close`.

    Args:
        url: where the service listens; proxies of the environment are used unless that is this machine.
        connection: an httpx client to use instead of an own one.
        api_key: where the service requires one; None: the environment's ROBOPROMPT_API_KEY.
        compress: send images as JPEG and PNG, for a slow network (needs the extra `images`); otherwise as they are,
            which saves both sides the time to encode and decode them. None: compressed where the extra is installed.
    """

    def plan(self, instruction: str, objects: Iterable[ObjectPose | str]) -> tuple[PlannedStep, ...]:
        """The steps of a sentence over tasks that were taught apart (`POST /plans`); `run_plan` carries them out.

        Args:
            objects: all of the scene, or their names; words of place need poses.

        Raises:
            ServiceProblemError, ServiceUnreachableError: a problem names the part that is not what one task does.
        """
        listed = [{"name": item} if isinstance(item, str) else object_json(item) for item in objects]
        steps = self._http.document("POST", "/plans", json={"instruction": instruction, "objects": listed})["steps"]
        return tuple(PlannedStep(step["task"], step["instruction"]) for step in steps)

    def predict(
        self,
        task: str | None,
        instruction: str,
        observation: Observation,
        *,
        mask_ids: Mapping[str, Sequence[int]] | None = None,
        timeout_s: float | None = None,
        **options: Any,  # noqa: ANN401
    ) -> PredictedActions:
        """The actions for what the robot sees now.

        Args:
            task: None: the one task of these objects that does what the instruction says; `response["task"]` names it.
            timeout_s: the service answers or gives up within it; None: within what the model needs, see `GET /models`.
            options: `model`, `representation`, `num_demonstrations` ..., see `POST /predict`.

        Raises:
            ServiceProblemError: if the service refuses, or the LLM's reply is no list of actions.
            ServiceUnreachableError: if the service does not answer.
            UnsafeActionError: if what it answers is no action: a number that is not finite, no unit quaternion ...
        """
        asked = options if timeout_s is None else {"timeout_s": timeout_s, **options}
        body = prediction_request(task, instruction, observation, mask_ids, asked, self._images)
        return PredictedActions.from_json(self._http.document("POST", "/predict", timeout=_wait_s(timeout_s), **body))

    def dry_run(
        self,
        task: str | None,
        instruction: str,
        observation: Observation,
        **options: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """The prompt that `predict` with the same options asks an LLM with; none is asked.

        Raises:
            ServiceProblemError: if the service refuses.
            ServiceUnreachableError: if it does not answer.
        """
        return self._http.document(
            "POST",
            "/predict",
            **prediction_request(task, instruction, observation, None, {**options, "dry_run": True}, self._images),
        )

    def stream(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        *,
        mask_ids: Mapping[str, Sequence[int]] | None = None,
        timeout_s: float | None = None,
        on_findings: Callable[[Sequence[Mapping[str, Any]]], None] | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Iterator[EndEffectorAction | PredictedActions]:
        """Each action as soon as the LLM has written it, then the whole answer.

        Args:
            on_findings: called with what the service doubts beforehand, ahead of the first action.

        Raises:
            RoboPromptError: as `predict`; also after actions were given, if the rest of the reply is missing.
            InvalidAnswerError: with `on_findings`, if the findings are not well formed.
        """
        asked = options if timeout_s is None else {"timeout_s": timeout_s, **options}
        body = prediction_request(task, instruction, observation, mask_ids, asked, self._images)
        index = 0
        for name, document in self._http.events("POST", "/predict", timeout=_wait_s(timeout_s), **body):
            if name == "findings" and on_findings is not None:
                on_findings(findings_in(document))
            elif name == "action":
                yield action_from_json(index, document)
                index += 1
            elif name == "done":
                yield PredictedActions.from_json(document)
                return
            elif name == "error":
                raise ServiceProblemError(document.get("status", 502), document)
        raise ServiceUnreachableError("POST /predict: the stream ended before it was complete")

    def find_poses(
        self, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
    ) -> tuple[ObjectPose, ...]:
        """Where objects are in images (`POST /poses`), apart from any task; nothing is stored.

        Args:
            object_models: by name, as `object_models` of a task.

        Raises:
            ServiceProblemError: if one of them is not found.
            ServiceUnreachableError: if it does not answer.
        """
        objects = [{"name": name, "model": dict(model)} for name, model in object_models.items()]
        return tuple(map(object_from_json, self.post("/poses", {"objects": objects}, frames)["poses"]))

    def record_outcome(self, prediction_id: str, success: bool, note: str | None = None) -> dict[str, Any]:
        """Tell the service how the robot fared with a prediction."""
        return self.post(f"/predictions/{prediction_id}/outcome", {"success": success, "note": note})

    def report_run(self, run_id: str, state: Mapping[str, Any], timeout_s: float) -> bool:
        """Tell where the robot is with a run (`PUT /runs/{run_id}`); returns whether it shall stop.

        Raises:
            ServiceProblemError, ServiceUnreachableError: it is not known whether it shall.
        """
        return self._stop("PUT", run_id, timeout_s, json=dict(state))

    def end_run(self, run_id: str, timeout_s: float) -> bool:
        """Tell that a run has ended; returns whether it was to be stopped, and raises, as `report_run`."""
        return self._stop("DELETE", run_id, timeout_s)

    def _stop(self, method: str, run_id: str, timeout_s: float, **body: Any) -> bool:  # noqa: ANN401
        answer = self._http.document(method, f"/runs/{run_id}", timeout=timeout_s, **body)
        if not isinstance(stop := answer.get("stop"), bool):
            raise ServiceUnreachableError(f"{method} /runs/{run_id}: what answers there is no RoboPrompt service")
        return stop


def _wait_s(timeout_s: float | None) -> float:
    """How long the connection may be silent."""
    return (LONGEST_S if timeout_s is None else timeout_s) + MARGIN_S
