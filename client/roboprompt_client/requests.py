"""What a service is asked, and how its answers are read: no transport, so that both clients share it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import httpx

from roboprompt_client.answers import PlannedStep, PredictedActions, findings_in
from roboprompt_client.camera import RgbdFrame, camera_json
from roboprompt_client.connection import Request, document_in, require_success
from roboprompt_client.encoding import ImageFormat, prediction_request, request_parts
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError
from roboprompt_client.motion_guard import action_from_json
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, object_from_json, object_json

LEARNING_TIMEOUT_S = 600.0
LONGEST_S = 600.0  # that the service gives a model where a request names no deadline
MARGIN_S = 10.0  # the service answers within the request's own deadline; this is for the way there and back
OnFindings = Callable[[Sequence[Mapping[str, Any]]], None]


class Requests:
    """The requests of a robot; each is a method of both clients, which send it and return what it reads.

    Args:
        images: how they travel.
    """

    def __init__(self, images: ImageFormat) -> None:
        self._images = images

    def ping(self) -> Request[None]:
        """Ask whether the service is there.

        Raises:
            ServiceUnreachableError: if it does not answer, or what answers is no RoboPrompt service.
            ServiceProblemError: if it refuses.
        """
        return Request("GET", "/healthz", {}, _pinged)

    def get(self, /, path: str, **parameters: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
        """Any document that the service offers, e.g. ``get("/episodes", task="open_drawer")``."""
        return ask("GET", path, params=parameters)

    def post(self, path: str, document: Mapping[str, Any], frames: Sequence[RgbdFrame] = ()) -> Request[dict[str, Any]]:
        """Send any document; with frames their cameras and images go along."""
        if not frames:
            return ask("POST", path, json=dict(document), timeout=LEARNING_TIMEOUT_S)
        metadata = {**document, "cameras": [camera_json(frame.camera) for frame in frames]}
        return ask("POST", path, files=request_parts(metadata, frames, self._images))

    def get_bytes(self, /, path: str, **parameters: Any) -> Request[bytes]:  # noqa: ANN401
        """Any file that the service offers, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return Request("GET", path, {"params": parameters}, lambda response: require_success(response).content)

    def plan(self, instruction: str, objects: Iterable[ObjectPose | str]) -> Request[tuple[PlannedStep, ...]]:
        """The steps of a sentence over tasks that were taught apart (`POST /plans`); `run_plan` carries them out.

        Args:
            objects: all of the scene, or their names; words of place need poses.

        Raises:
            ServiceProblemError, ServiceUnreachableError: a problem names the part that is not what one task does.
        """
        listed = [{"name": item} if isinstance(item, str) else object_json(item) for item in objects]
        asked = ask("POST", "/plans", json={"instruction": instruction, "objects": listed})
        return asked.then(
            lambda answer: tuple(PlannedStep(step["task"], step["instruction"]) for step in answer["steps"])
        )

    def predict(
        self,
        /,
        task: str | None,
        instruction: str,
        observation: Observation,
        *,
        mask_ids: Mapping[str, Sequence[int]] | None = None,
        timeout_s: float | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Request[PredictedActions]:
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
        return ask("POST", "/predict", timeout=_wait_s(timeout_s), **body).then(PredictedActions.from_json)

    def dry_run(
        self,
        /,
        task: str | None,
        instruction: str,
        observation: Observation,
        **options: Any,  # noqa: ANN401
    ) -> Request[dict[str, Any]]:
        """The prompt that `predict` with the same options asks an LLM with; none is asked.

        Raises:
            ServiceProblemError: if the service refuses.
            ServiceUnreachableError: if it does not answer.
        """
        asked = {**options, "dry_run": True}
        return ask("POST", "/predict", **prediction_request(task, instruction, observation, None, asked, self._images))

    def find_poses(
        self, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
    ) -> Request[tuple[ObjectPose, ...]]:
        """Where objects are in images (`POST /poses`), apart from any task; nothing is stored.

        Args:
            object_models: by name, as `object_models` of a task.

        Raises:
            ServiceProblemError: if one of them is not found.
            ServiceUnreachableError: if it does not answer.
        """
        objects = [{"name": name, "model": dict(model)} for name, model in object_models.items()]
        asked = self.post("/poses", {"objects": objects}, frames)
        return asked.then(lambda answer: tuple(map(object_from_json, answer["poses"])))

    def record_outcome(self, prediction_id: str, success: bool, note: str | None = None) -> Request[dict[str, Any]]:
        """Tell the service how the robot fared with a prediction."""
        return self.post(f"/predictions/{prediction_id}/outcome", {"success": success, "note": note})

    def report_run(self, run_id: str, state: Mapping[str, Any], timeout_s: float) -> Request[bool]:
        """Tell where the robot is with a run (`PUT /runs/{run_id}`); returns whether it shall stop.

        Raises:
            ServiceProblemError, ServiceUnreachableError: it is not known whether it shall.
        """
        return ask("PUT", f"/runs/{run_id}", json=dict(state), timeout=timeout_s).then(_stop)

    def end_run(self, run_id: str, timeout_s: float) -> Request[bool]:
        """Tell that a run has ended; returns whether it was to be stopped, and raises, as `report_run`."""
        return ask("DELETE", f"/runs/{run_id}", timeout=timeout_s).then(_stop)


class StreamReader:
    """What the events of a prediction say, one after the other.

    Args:
        on_findings: called with what the service doubts beforehand, ahead of the first action.
    """

    def __init__(self, on_findings: OnFindings | None) -> None:
        self._on_findings, self._index = on_findings, 0

    def read(self, name: str, document: Mapping[str, Any]) -> EndEffectorAction | PredictedActions | None:
        """An action, the whole answer, which is the last one, or nothing to hand on.

        Raises:
            ServiceProblemError: for an event that says so.
            InvalidAnswerError, UnsafeActionError: for findings and actions that are not well formed.
        """
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


CUT_OFF = "POST /predict: the stream ended before it was complete"


def ask(method: str, path: str, **arguments: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
    """A request for a JSON object; arguments as of `httpx.Client.request`."""
    return Request(method, path, arguments, document_in)


def _pinged(response: httpx.Response) -> None:
    try:
        known = document_in(response).get("checks") is not None
    except ServiceProblemError as error:
        if "type" in error.problem:
            raise
        known = False
    if not known:
        address = str(response.url).removesuffix("/healthz")
        raise ServiceUnreachableError(f"{address}: what answers there is no RoboPrompt service")


def _stop(answer: Mapping[str, Any]) -> bool:
    if not isinstance(stop := answer.get("stop"), bool):
        raise ServiceUnreachableError("/runs: what answers there is no RoboPrompt service")
    return stop


def _wait_s(timeout_s: float | None) -> float:
    """How long the connection may be silent."""
    return (LONGEST_S if timeout_s is None else timeout_s) + MARGIN_S
