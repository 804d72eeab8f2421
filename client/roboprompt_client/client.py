"""The client of the service: each method sends a request and returns what it reads from the answer."""

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar
from uuid import uuid4

import httpx

from roboprompt_client.answers import PlannedStep, PredictedActions
from roboprompt_client.encoding import LONGEST_S, Part, episode_parts, request_parts, scene_json
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError
from roboprompt_client.http import document_in, http_options, require_success, transport_errors
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.poses import ObjectPose, object_from_json, object_json
from roboprompt_client.types.trajectory import Trajectory

OfKind = TypeVar("OfKind", bound="RoboPromptClient")
DEFAULT_URL = os.environ.get("ROBOPROMPT_URL") or "http://127.0.0.1:8000"
LEARNING_TIMEOUT_S = 600.0
MARGIN_S = 10.0  # the service answers within a request's own deadline; this is for the way there and back
CHECK_TIMEOUT_S = 1260.0  # ten predictions of at most two minutes each


class RoboPromptClient:
    """Upload demonstrations and ask for actions. Use it as a context manager, or call `close`.

    Its methods raise ServiceProblemError if the service refuses, and ServiceUnreachableError if nothing answers or what
    answers is not a RoboPrompt service.

    Args:
        url: where the service listens. Proxies of the environment are used unless the service runs on this machine.
        connection: an httpx client to use instead of a new one.
        api_key: for a service that requires one; None: the environment's ROBOPROMPT_API_KEY.
    """

    def __init__(
        self, url: str = DEFAULT_URL, connection: httpx.Client | None = None, *, api_key: str | None = None
    ) -> None:
        self._http = connection or httpx.Client(**http_options(url, api_key))

    def __enter__(self: OfKind) -> OfKind:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where the service listens."""
        return str(self._http.base_url)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def _send(self, method: str, path: str, **arguments: Any) -> httpx.Response:  # noqa: ANN401
        with transport_errors(method, f"{self.url.rstrip('/')}/{path.lstrip('/')}"):
            return self._http.request(method, path, **arguments)

    def _ask(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:  # noqa: ANN401
        return document_in(self._send(method, path, **arguments))

    def ping(self) -> None:
        """Return if a RoboPrompt service answers, else raise."""
        response = self._send("GET", "/healthz")
        try:
            known = document_in(response).get("checks") is not None
        except ServiceProblemError as error:
            if "type" in error.problem:
                raise
            known = False
        if not known:
            address = str(response.url).removesuffix("/healthz")
            raise ServiceUnreachableError(f"{address}: what answers there is not a RoboPrompt service")

    def get(self, /, path: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return any JSON document of the service, e.g. ``get("/episodes", task="open_drawer")``."""
        return self._ask("GET", path, params=parameters)

    def post(
        self,
        path: str,
        document: Mapping[str, Any],
        frames: Sequence[RgbdFrame] = (),
        timeout_s: float = LEARNING_TIMEOUT_S,
    ) -> dict[str, Any]:
        """Send a JSON document, with the frames' cameras and images if there are frames; return the answer."""
        if not frames:
            return self._ask("POST", path, json=dict(document), timeout=timeout_s)
        metadata = {**document, "cameras": [camera_json(frame.camera) for frame in frames]}
        return self._ask("POST", path, files=request_parts(metadata, frames), timeout=timeout_s)

    def get_bytes(self, /, path: str, **parameters: Any) -> bytes:  # noqa: ANN401
        """Return any file of the service, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return require_success(self._send("GET", path, params=parameters)).content

    def plan(self, instruction: str, objects: Iterable[ObjectPose | str]) -> tuple[PlannedStep, ...]:
        """Return the steps of a sentence over several tasks (`POST /plans`); `run_plan` carries them out.

        `objects` are all of the scene, or their names; words such as "left" need poses. The problem of a refusal names
        the part of the sentence that fits no task or several.
        """
        listed = [{"name": item} if isinstance(item, str) else object_json(item) for item in objects]
        answer = self._ask("POST", "/plans", json={"instruction": instruction, "objects": listed})
        return tuple(PlannedStep(step["task"], step["instruction"]) for step in answer["steps"])

    def predict(
        self,
        /,
        task: str | None,
        instruction: str,
        observation: Observation,
        *,
        timeout_s: float | None = None,
        **options: Any,  # noqa: ANN401
    ) -> PredictedActions:
        """Return the actions for what the robot sees now.

        Args:
            task: None lets the service choose the task by instruction and objects; `response["task"]` names it.
            timeout_s: the service answers or gives up within it; None: within what the model needs, see `GET /models`.
            options: `model`, `representation`, `num_demonstrations` ..., see `POST /predict`.

        Raises:
            ServiceProblemError: also if the LLM's reply is not a list of actions.
            UnsafeActionError: if an action of the answer has a number that is not finite, no unit quaternion ...
        """
        document = {"task": task, "instruction": instruction, **scene_json(observation), **options}
        if timeout_s is not None:
            document["timeout_s"] = timeout_s
        if (pose := observation.end_effector) is not None:
            document["end_effector"] = {"position": pose.position_m, "quaternion_xyzw": pose.quaternion_xyzw}
        wait_s = (LONGEST_S if timeout_s is None else timeout_s) + MARGIN_S  # for which nothing may come
        return PredictedActions.from_json(self.post("/predict", document, observation.frames, wait_s))

    def find_poses(
        self, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
    ) -> tuple[ObjectPose, ...]:
        """Return the poses of objects in images (`POST /poses`), each by its model as in a task's `object_models`.

        Raises ServiceProblemError also if one of the objects is not found; nothing is stored.
        """
        objects = [{"name": name, "model": dict(model)} for name, model in object_models.items()]
        return tuple(map(object_from_json, self.post("/poses", {"objects": objects}, frames)["poses"]))

    def record_outcome(self, prediction_id: str, success: bool, note: str | None = None) -> dict[str, Any]:
        """Tell the service whether the robot did the task with this prediction."""
        return self.post(f"/predictions/{prediction_id}/outcome", {"success": success, "note": note})

    def configure_task(self, /, task: str, *, version: int | None = None, **settings: Any) -> dict[str, Any]:  # noqa: ANN401
        """Set a task's settings, see `PUT /tasks/{name}`; return all of them.

        The service refuses (409) if the task has changed since `version`; None: no such check.
        """
        return self._ask("PUT", f"/tasks/{task}", json=settings, params={} if version is None else {"version": version})

    def motion_limits(self, task: str) -> MotionLimits:
        """Return the task's limits of motion; raises InvalidInputError for a bound that is missing or cannot hold."""
        return MotionLimits.from_task(self.get(f"/tasks/{task}"))

    def upload(
        self,
        task: str,
        instruction: str,
        trajectory: Trajectory,
        observation: Observation,
        *,
        control_frequency_hz: float = 20.0,
        extra: Mapping[str, Any] | None = None,
        prediction_id: str | None = None,
        corrects: str | None = None,
    ) -> dict[str, Any]:
        """Store a demonstration; return the service's description of it.

        Args:
            observation: what the robot saw at the first frame.
            prediction_id: of the prediction that the robot carried out successfully in this episode.
            corrects: id of the prediction that failed, and in whose scene the episode shows how it is done.
        """
        known = {"prediction_id": prediction_id, "corrects": corrects, "extra": dict(extra or {})}
        metadata = {"task": task, "instruction": instruction, "control_frequency_hz": control_frequency_hz, **known}
        return self.upload_parts(episode_parts(metadata, trajectory, observation), uuid4().hex)

    def upload_parts(self, parts: Mapping[str, Part], idempotency_key: str) -> dict[str, Any]:
        """Store a demonstration encoded as the parts of `POST /episodes`; the same key and content only once."""
        return self._ask("POST", "/episodes", files=parts, headers={"Idempotency-Key": idempotency_key})

    def edit_episode(self, /, episode_id: str, **changes: Any) -> dict[str, Any]:  # noqa: ANN401
        """Change `instruction`, `left_out` or `note` of an episode, see `PATCH /episodes/{id}`; return the episode."""
        return self._ask("PATCH", f"/episodes/{episode_id}", json=changes)

    def check(self, task: str) -> dict[str, Any]:
        """Return what a task's demonstrations share, and each held against the others: `GET /tasks/{name}/check`."""
        return self._ask("GET", f"/tasks/{task}/check", timeout=CHECK_TIMEOUT_S)

    def learn_object_models(
        self, task: str, objects: Sequence[str] | None = None, episodes: int = 10
    ) -> dict[str, Any]:
        """Let the service learn from at most so many labeled episodes what objects (None: all) of a task look like.

        Return `object_models`, and in `refused` by object why nothing was learned.
        """
        asked = {"objects": None if objects is None else list(objects), "episodes": episodes}
        return self.post(f"/tasks/{task}/object_models/learn", asked)

    def label_object(
        self,
        /,
        task: str,
        name: str,
        episode_id: str | None = None,
        frames: Sequence[RgbdFrame] = (),
        **where: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """Label an object in an episode's first pictures or in frames (`POST /tasks/{name}/labels`); return the label.

        `where` has `clicks`, `polygons` or `mask_ids`, and `yaw_deg`.
        """
        return self.post(f"/tasks/{task}/labels", {"object": name, "episode_id": episode_id, **where}, frames)

    def learn_from_labels(self, task: str, name: str, symmetric: str | float = "none") -> dict[str, Any]:
        """Let the service learn what a labeled object looks like, see `POST /tasks/{name}/labels/learn`.

        `symmetric` is "none", "yaw" if it looks the same from all sides, or the angle in degrees after which it does.
        """
        return self.post(f"/tasks/{task}/labels/learn", {"object": name, "symmetric": symmetric})
