"""The service as a robot sees it."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar
from uuid import uuid4

import httpx

from roboprompt_client.answers import PlannedStep, PredictedActions, findings_in
from roboprompt_client.camera import RgbdFrame, camera_json
from roboprompt_client.connection import Connection, open_http
from roboprompt_client.encoding import ImageFormat, Part, prediction_request, request_parts, scene_json
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError
from roboprompt_client.motion_guard import action_from_json
from roboprompt_client.motion_limits import MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, Trajectory, object_from_json, object_json
from roboprompt_client.trajectory_npz import npz_from_trajectory

OfKind = TypeVar("OfKind", bound="RoboPromptClient")
KEY_VARIABLE = "ROBOPROMPT_API_KEY"
DEFAULT_URL = "http://127.0.0.1:8000"
LEARNING_TIMEOUT_S = 600.0
CHECK_TIMEOUT_S = 1260.0  # ten predictions of at most two minutes each
LONGEST_S = 300.0  # that the service gives a model where a request names no deadline
MARGIN_S = 10.0  # the service answers within the request's own deadline; this is for the way there and back


class RoboPromptClient:
    """Uploads demonstrations and asks for actions. Use it as a context manager, or call `close`.

    Args:
        url: where the service listens; proxies of the environment are used unless that is this machine.
        connection: an httpx client to use instead of an own one.
        api_key: where the service requires one; None: the environment's ROBOPROMPT_API_KEY.
        compress: send images as JPEG and PNG, for a slow network (needs the extra `images`); otherwise as they are,
            which saves both sides the time to encode and decode them. None: compressed where the extra is installed.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        connection: httpx.Client | None = None,
        *,
        api_key: str | None = None,
        compress: bool | None = None,
    ) -> None:
        key = os.environ.get(KEY_VARIABLE, "") if api_key is None else api_key
        self._http = Connection(connection or open_http(url, key))
        self._images = ImageFormat.chosen(compress)

    def __enter__(self: OfKind) -> OfKind:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where the service listens."""
        return str(self._http.client.base_url)

    def close(self) -> None:
        """Close the connections."""
        self._http.client.close()

    def ping(self) -> None:
        """Ask whether the service is there.

        Raises:
            ServiceUnreachableError: if it does not answer, or what answers is no RoboPrompt service.
            ServiceProblemError: if it refuses.
        """
        try:
            known = self.get("/healthz").get("checks") is not None
        except ServiceProblemError as error:
            if "type" in error.problem:
                raise
            known = False
        if not known:
            raise ServiceUnreachableError(f"{self.url}: what answers there is no RoboPrompt service")

    def configure_task(self, task: str, **settings: Any) -> dict[str, Any]:  # noqa: ANN401
        """Set a task's settings, see `PUT /tasks/{name}`; returns all of them."""
        return self._http.document("PUT", f"/tasks/{task}", json=settings)

    def motion_limits(self, task: str) -> MotionLimits:
        """What the task allows an action."""
        return MotionLimits.from_task(self.get(f"/tasks/{task}"))

    def upload(
        self,
        task: str,
        instruction: str,
        trajectory: Trajectory,
        observation: Observation,
        *,
        control_frequency_hz: float = 20.0,
        mask_ids: Mapping[str, Sequence[int]] | None = None,
        extra: Mapping[str, Any] | None = None,
        prediction_id: str | None = None,
    ) -> dict[str, Any]:
        """Store a demonstration; returns the service's description of it.

        Args:
            observation: what the robot saw at the first frame.
            mask_ids: for objects whose pixels the masks show, the ids of these; instead of a pose or beside it.
            prediction_id: of the prediction that the robot carried out with success in this episode.

        Raises:
            ServiceProblemError: if the service refuses it.
            ServiceUnreachableError: if the service does not answer.
        """
        metadata = {
            "task": task,
            "instruction": instruction,
            **scene_json(observation, mask_ids),
            "control_frequency_hz": control_frequency_hz,
            "extra": dict(extra or {}),
            "prediction_id": prediction_id,
        }
        parts = request_parts(metadata, observation.frames, self._images)
        parts["trajectory"] = ("trajectory.npz", npz_from_trajectory(trajectory), "application/octet-stream")
        return self.upload_parts(parts, uuid4().hex)

    def upload_parts(self, parts: Mapping[str, Part], idempotency_key: str) -> dict[str, Any]:
        """Store a demonstration that is encoded already: the parts of `POST /episodes`.

        Args:
            idempotency_key: sent again with the same content it stores nothing twice.

        Raises:
            ServiceProblemError, ServiceUnreachableError: as `upload`.
        """
        return self._http.document("POST", "/episodes", files=parts, headers={"Idempotency-Key": idempotency_key})

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

    def learn_object_models(
        self, task: str, objects: Sequence[str] | None = None, episodes: int = 10
    ) -> dict[str, Any]:
        """Let the service learn what the task's objects look like from its labeled episodes.

        Returns `object_models`, and in `refused` why nothing was learned of an object.

        Args:
            objects: None for all.
            episodes: from at most so many, the task's first.

        Raises:
            ServiceProblemError: if the service refuses.
            ServiceUnreachableError: if it does not answer.
        """
        asked = {"objects": None if objects is None else list(objects), "episodes": episodes}
        return self.post(f"/tasks/{task}/object_models/learn", asked)

    def label_object(self, task: str, name: str, episode_id: str, **where: Any) -> dict[str, Any]:  # noqa: ANN401
        """Say where an object is in an episode's images, see `POST /tasks/{name}/labels`.

        Args:
            where: `clicks`, `polygons` or `mask_ids`, and `yaw_deg`.

        Raises:
            ServiceProblemError, ServiceUnreachableError.
        """
        asked = {"object": name, "episode_id": episode_id, **where}
        return self._http.document("POST", f"/tasks/{task}/labels", json=asked)

    def learn_from_labels(self, task: str, name: str, symmetric: str | float = "none") -> dict[str, Any]:
        """Let the service learn what a labeled object looks like, see `POST /tasks/{name}/labels/learn`.

        Args:
            symmetric: "none", "yaw" for what looks the same all around, or degrees of a turn that changes nothing.

        Raises:
            ServiceProblemError: if the labels give no template, or an episode's images do not show the object.
            ServiceUnreachableError.
        """
        asked = {"object": name, "symmetric": symmetric}
        return self._http.document("POST", f"/tasks/{task}/labels/learn", json=asked, timeout=LEARNING_TIMEOUT_S)

    def check(self, task: str, model: str | None = None) -> dict[str, Any]:
        """Predict each of a task's demonstrations from the others, see `GET /tasks/{name}/check`.

        Args:
            model: an LLM to ask as well, which takes it some seconds for each demonstration.

        Raises:
            ServiceProblemError: if the service refuses.
            ServiceUnreachableError: if it does not answer.
        """
        asked = {} if model is None else {"model": model}
        return self._http.document("GET", f"/tasks/{task}/check", params=asked, timeout=CHECK_TIMEOUT_S)

    def edit_episode(
        self, episode_id: str, *, instruction: str | None = None, left_out: bool | None = None, note: str | None = None
    ) -> dict[str, Any]:
        """Correct an episode; what is None stays. Returns the episode.

        Args:
            left_out: whether it is kept, but shown in no prompt.
            note: for people; empty for none.

        Raises:
            ServiceProblemError, ServiceUnreachableError.
        """
        wanted = {"instruction": instruction, "left_out": left_out, "note": note}
        changes = {name: value for name, value in wanted.items() if value is not None}
        return self._http.document("PATCH", f"/episodes/{episode_id}", json=changes)

    def record_outcome(self, prediction_id: str, success: bool, note: str | None = None) -> dict[str, Any]:
        """Tell the service how the robot fared with a prediction."""
        return self.post(f"/predictions/{prediction_id}/outcome", {"success": success, "note": note})

    def get(self, path: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401
        """Any document that the service offers, e.g. ``get("/episodes", task="open_drawer")``."""
        return self._http.document("GET", path, params=parameters)

    def post(self, path: str, document: Mapping[str, Any], frames: Sequence[RgbdFrame] = ()) -> dict[str, Any]:
        """Send any document; with frames their cameras and images go along."""
        if not frames:
            return self._http.document("POST", path, json=dict(document), timeout=LEARNING_TIMEOUT_S)
        metadata = {**document, "cameras": [camera_json(frame.camera) for frame in frames]}
        return self._http.document("POST", path, files=request_parts(metadata, frames, self._images))

    def get_bytes(self, path: str, **parameters: Any) -> bytes:  # noqa: ANN401
        """Any file that the service offers, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return self._http.request("GET", path, params=parameters).content


def _wait_s(timeout_s: float | None) -> float:
    """How long the connection may be silent."""
    return (LONGEST_S if timeout_s is None else timeout_s) + MARGIN_S
