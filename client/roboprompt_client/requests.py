"""The requests to the service, each with how its answer is read; sending them is left to the two clients."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from uuid import uuid4

import httpx

from roboprompt_client.answers import PlannedStep, PredictedActions
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError
from roboprompt_client.http.connection import Request, document_in, require_success
from roboprompt_client.http.encoding import Part, npz_part, prediction_request, request_parts, scene_json
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.film import Film, npz_from_film
from roboprompt_client.types.poses import ObjectPose, object_from_json, object_json
from roboprompt_client.types.trajectory import Trajectory
from roboprompt_client.types.trajectory_npz import npz_from_trajectory

LEARNING_TIMEOUT_S = 600.0
CHECK_TIMEOUT_S = 1260.0  # ten predictions of at most two minutes each
LONGEST_S = 600.0  # that the service gives a model where a request names no deadline
MARGIN_S = 10.0  # the service answers within the request's own deadline; this is for the way there and back


class Requests:
    """The requests of a robot. Each is a method of both clients, which send it and return what it reads.

    The clients' methods raise ServiceProblemError if the service refuses, and ServiceUnreachableError if nothing
    answers or what answers is not a RoboPrompt service.
    """

    def ping(self) -> Request[None]:
        """Return if a RoboPrompt service answers, else raise."""
        return Request("GET", "/healthz", {}, _pinged)

    def get(self, /, path: str, **parameters: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
        """Return any JSON document of the service, e.g. ``get("/episodes", task="open_drawer")``."""
        return ask("GET", path, params=parameters)

    def post(self, path: str, document: Mapping[str, Any], frames: Sequence[RgbdFrame] = ()) -> Request[dict[str, Any]]:
        """Send a JSON document, with the frames' cameras and images if there are frames; return the answer."""
        if not frames:
            return ask("POST", path, json=dict(document), timeout=LEARNING_TIMEOUT_S)
        metadata = {**document, "cameras": [camera_json(frame.camera) for frame in frames]}
        return ask("POST", path, files=request_parts(metadata, frames))

    def get_bytes(self, /, path: str, **parameters: Any) -> Request[bytes]:  # noqa: ANN401
        """Return any file of the service, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return Request("GET", path, {"params": parameters}, lambda response: require_success(response).content)

    def plan(self, instruction: str, objects: Iterable[ObjectPose | str]) -> Request[tuple[PlannedStep, ...]]:
        """Return the steps of a sentence over several tasks (`POST /plans`); `run_plan` carries them out.

        Args:
            objects: all objects of the scene, or their names; words such as "left" need poses.

        Raises:
            ServiceProblemError: also if a part of the sentence fits no task or several; the problem names the part.
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
        timeout_s: float | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Request[PredictedActions]:
        """Return the actions for what the robot sees now.

        Args:
            task: None lets the service choose the task by instruction and objects; `response["task"]` names it.
            timeout_s: the service answers or gives up within it; None: within what the model needs, see `GET /models`.
            options: `model`, `representation`, `num_demonstrations` ..., see `POST /predict`.

        Raises:
            ServiceProblemError: also if the LLM's reply is not a list of actions.
            UnsafeActionError: if an action of the answer has a number that is not finite, no unit quaternion ...
        """
        asked = options if timeout_s is None else {"timeout_s": timeout_s, **options}
        body = prediction_request(task, instruction, observation, asked)
        wait_s = (LONGEST_S if timeout_s is None else timeout_s) + MARGIN_S  # for which nothing may come
        return ask("POST", "/predict", timeout=wait_s, **body).then(PredictedActions.from_json)

    def find_poses(
        self, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
    ) -> Request[tuple[ObjectPose, ...]]:
        """Return the poses of objects in images (`POST /poses`), independent of tasks; nothing is stored.

        Args:
            object_models: by object name, as in a task's `object_models`.

        Raises:
            ServiceProblemError: also if one of the objects is not found.
        """
        objects = [{"name": name, "model": dict(model)} for name, model in object_models.items()]
        asked = self.post("/poses", {"objects": objects}, frames)
        return asked.then(lambda answer: tuple(map(object_from_json, answer["poses"])))

    def record_outcome(self, prediction_id: str, success: bool, note: str | None = None) -> Request[dict[str, Any]]:
        """Tell the service whether the robot did the task with this prediction."""
        return self.post(f"/predictions/{prediction_id}/outcome", {"success": success, "note": note})

    def report_run(self, run_id: str, state: Mapping[str, Any], timeout_s: float) -> Request[bool]:
        """Report the state of a run (`PUT /runs/{run_id}`); return whether the robot shall stop."""
        return ask("PUT", f"/runs/{run_id}", json=dict(state), timeout=timeout_s).then(_stop)

    def end_run(self, run_id: str, timeout_s: float) -> Request[bool]:
        """Report that a run has ended; return whether the robot was to stop."""
        return ask("DELETE", f"/runs/{run_id}", timeout=timeout_s).then(_stop)

    def configure_task(self, /, task: str, *, version: int | None = None, **settings: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
        """Set a task's settings, see `PUT /tasks/{name}`; return all of them.

        Args:
            version: the task's version for which the settings were chosen; the service refuses (409) if the task has
                changed since. None: no such check.
        """
        return ask("PUT", f"/tasks/{task}", json=settings, params={} if version is None else {"version": version})

    def motion_limits(self, task: str) -> Request[MotionLimits]:
        """Return the task's limits of motion; raises InvalidInputError for a bound that is missing or cannot hold."""
        return self.get(f"/tasks/{task}").then(MotionLimits.from_task)

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
        films: Iterable[Film] = (),
        corrects: str | None = None,
    ) -> Request[dict[str, Any]]:
        """Store a demonstration; return the service's description of it.

        Args:
            observation: what the robot saw at the first frame.
            prediction_id: of the prediction that the robot carried out successfully in this episode.
            films: what cameras took during the motion, such as `Recorder.films`.
            corrects: id of the prediction that failed, and in whose scene the episode shows how it is done.
        """
        metadata = {
            "task": task,
            "instruction": instruction,
            **scene_json(observation),
            "control_frequency_hz": control_frequency_hz,
            "extra": dict(extra or {}),
            "prediction_id": prediction_id,
            "corrects": corrects,
        }
        parts = request_parts(metadata, observation.frames)
        parts["trajectory"] = npz_part("trajectory", npz_from_trajectory(trajectory))
        parts |= {film.field: npz_part(film.field, npz_from_film(film)) for film in films}
        return self.upload_parts(parts, uuid4().hex)

    def upload_parts(self, parts: Mapping[str, Part], idempotency_key: str) -> Request[dict[str, Any]]:
        """Store a demonstration that is already encoded as the parts of `POST /episodes`.

        Args:
            idempotency_key: the same key with the same content stores the demonstration only once.
        """
        return ask("POST", "/episodes", files=parts, headers={"Idempotency-Key": idempotency_key})

    def edit_episode(
        self,
        episode_id: str,
        *,
        instruction: str | None = None,
        left_out: bool | None = None,
        note: str | None = None,
        trim_s: tuple[float, float] | None = None,
    ) -> Request[dict[str, Any]]:
        """Change an episode's members that are not None; return the episode.

        Args:
            left_out: True keeps the episode but shows it in no prompt.
            note: for people; "" removes it.
            trim_s: beginning and end of the part that is kept, from the first recorded frame.
        """
        trim = None if trim_s is None else {"start_s": trim_s[0], "end_s": trim_s[1]}
        wanted = {"instruction": instruction, "left_out": left_out, "note": note, "trim": trim}
        changes = {name: value for name, value in wanted.items() if value is not None}
        return ask("PATCH", f"/episodes/{episode_id}", json=changes)

    def check(self, task: str, model: str | None = None) -> Request[dict[str, Any]]:
        """Return how well each demonstration of a task follows from the others, see `GET /tasks/{name}/check`.

        Args:
            model: an LLM to ask as well; it takes some seconds for each demonstration.
        """
        asked = {} if model is None else {"model": model}
        return ask("GET", f"/tasks/{task}/check", params=asked, timeout=CHECK_TIMEOUT_S)

    def learn_object_models(
        self, task: str, objects: Sequence[str] | None = None, episodes: int = 10
    ) -> Request[dict[str, Any]]:
        """Let the service learn from labeled episodes what the task's objects look like.

        Return `object_models`, and in `refused` by object why nothing was learned.

        Args:
            objects: names; None: all.
            episodes: how many of the task's episodes to learn from at most, the oldest first.
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
    ) -> Request[dict[str, Any]]:
        """Label an object in pictures, see `POST /tasks/{name}/labels`; return the label.

        Args:
            episode_id: of the episode whose first pictures are labeled; or:
            frames: pictures with color and depth.
            where: `clicks`, `polygons` or `mask_ids`, and `yaw_deg`.
        """
        return self.post(f"/tasks/{task}/labels", {"object": name, "episode_id": episode_id, **where}, frames)

    def learn_from_labels(self, task: str, name: str, symmetric: str | float = "none") -> Request[dict[str, Any]]:
        """Let the service learn what a labeled object looks like, see `POST /tasks/{name}/labels/learn`.

        Args:
            symmetric: "none", "yaw" if it looks the same from all sides, or the angle in degrees after which it does.

        Raises:
            ServiceProblemError: also if the labels are too few or disagree.
        """
        return self.post(f"/tasks/{task}/labels/learn", {"object": name, "symmetric": symmetric})


def ask(method: str, path: str, **arguments: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
    """Return a request for a JSON object; arguments as of `httpx.Client.request`."""
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
        raise ServiceUnreachableError(f"{address}: what answers there is not a RoboPrompt service")


def _stop(answer: Mapping[str, Any]) -> bool:
    if not isinstance(stop := answer.get("stop"), bool):
        raise ServiceUnreachableError("/runs: what answers there is not a RoboPrompt service")
    return stop
