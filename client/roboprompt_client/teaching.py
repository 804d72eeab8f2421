"""Requests by which a robot teaches: a task's settings, its demonstrations, and what its objects look like."""

from collections.abc import Mapping, Sequence
from typing import Any
from uuid import uuid4

from roboprompt_client.connection import Request
from roboprompt_client.encoding import Part, request_parts, scene_json
from roboprompt_client.motion_limits import MotionLimits
from roboprompt_client.requests import LEARNING_TIMEOUT_S, Requests, ask
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import Trajectory
from roboprompt_client.trajectory_npz import npz_from_trajectory

CHECK_TIMEOUT_S = 1260.0  # ten predictions of at most two minutes each


class TeachingRequests(Requests):
    """The requests that are about tasks and their episodes."""

    def configure_task(self, /, task: str, **settings: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
        """Set a task's settings, see `PUT /tasks/{name}`; returns all of them."""
        return ask("PUT", f"/tasks/{task}", json=settings)

    def motion_limits(self, task: str) -> Request[MotionLimits]:
        """What the task allows an action."""
        return self.get(f"/tasks/{task}").then(MotionLimits.from_task)

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
    ) -> Request[dict[str, Any]]:
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

    def upload_parts(self, parts: Mapping[str, Part], idempotency_key: str) -> Request[dict[str, Any]]:
        """Store a demonstration that is encoded already: the parts of `POST /episodes`.

        Args:
            idempotency_key: sent again with the same content it stores nothing twice.

        Raises:
            ServiceProblemError, ServiceUnreachableError: as `upload`.
        """
        return ask("POST", "/episodes", files=parts, headers={"Idempotency-Key": idempotency_key})

    def edit_episode(
        self, episode_id: str, *, instruction: str | None = None, left_out: bool | None = None, note: str | None = None
    ) -> Request[dict[str, Any]]:
        """Correct an episode; what is None stays. Returns the episode.

        Args:
            left_out: whether it is kept, but shown in no prompt.
            note: for people; empty for none.

        Raises:
            ServiceProblemError, ServiceUnreachableError.
        """
        wanted = {"instruction": instruction, "left_out": left_out, "note": note}
        changes = {name: value for name, value in wanted.items() if value is not None}
        return ask("PATCH", f"/episodes/{episode_id}", json=changes)

    def check(self, task: str, model: str | None = None) -> Request[dict[str, Any]]:
        """Predict each of a task's demonstrations from the others, see `GET /tasks/{name}/check`.

        Args:
            model: an LLM to ask as well, which takes it some seconds for each demonstration.

        Raises:
            ServiceProblemError: if the service refuses.
            ServiceUnreachableError: if it does not answer.
        """
        asked = {} if model is None else {"model": model}
        return ask("GET", f"/tasks/{task}/check", params=asked, timeout=CHECK_TIMEOUT_S)

    def learn_object_models(
        self, task: str, objects: Sequence[str] | None = None, episodes: int = 10
    ) -> Request[dict[str, Any]]:
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

    def label_object(self, /, task: str, name: str, episode_id: str, **where: Any) -> Request[dict[str, Any]]:  # noqa: ANN401
        """Say where an object is in an episode's images, see `POST /tasks/{name}/labels`.

        Args:
            where: `clicks`, `polygons` or `mask_ids`, and `yaw_deg`.

        Raises:
            ServiceProblemError, ServiceUnreachableError.
        """
        asked = {"object": name, "episode_id": episode_id, **where}
        return ask("POST", f"/tasks/{task}/labels", json=asked)

    def learn_from_labels(self, task: str, name: str, symmetric: str | float = "none") -> Request[dict[str, Any]]:
        """Let the service learn what a labeled object looks like, see `POST /tasks/{name}/labels/learn`.

        Args:
            symmetric: "none", "yaw" for what looks the same all around, or degrees of a turn that changes nothing.

        Raises:
            ServiceProblemError: if the labels give no template, or an episode's images do not show the object.
            ServiceUnreachableError.
        """
        asked = {"object": name, "symmetric": symmetric}
        return ask("POST", f"/tasks/{task}/labels/learn", json=asked, timeout=LEARNING_TIMEOUT_S)
