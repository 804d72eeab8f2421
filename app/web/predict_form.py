"""What the page Predict is filled in with: from a task, an episode, or a prediction that is tried again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from sqlalchemy import Connection

from app.services.task_settings import TaskSettings
from app.store import episodes, predictions, tasks
from app.store.records import EpisodeRecord, TaskRecord
from app.store.values import CameraRecord, JsonObject, ObjectRecord

NUM_EPISODES = 100  # offered to take a scene from
SETTINGS = (
    "model",
    "representation",
    "prompt_format",
    "system_prompt",
    "num_demonstrations",
    "selection",
    "seed",
    "episode_ids",
    "unfamiliar",
    "max_actions",
    "timeout_s",
    "num_samples",
    "temperature",
    "end_effector",
)
ImageKind = Literal["rgb", "depth", "mask"]


@dataclass(frozen=True)
class ObjectField:
    """An object's fields; `pose` is None where nobody knows it yet."""

    name: str
    pose: ObjectRecord | None
    mask_ids: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class PredictForm:
    """The page's fields.

    Attributes:
        from_episode: whose scene it is; None for the scene of `again`.
        again: id of the prediction that is tried again.
        settings: as a request names them; None follows the task, then the model.
    """

    task: TaskRecord
    task_settings: TaskSettings
    instruction: str
    objects: tuple[ObjectField, ...]
    cameras: tuple[CameraRecord, ...]
    instructions: tuple[str, ...]
    episodes: tuple[EpisodeRecord, ...]
    from_episode: EpisodeRecord | None
    again: str | None = None
    settings: Mapping[str, Any] = field(default_factory=lambda: dict.fromkeys(SETTINGS))

    @property
    def looks(self) -> bool:
        """Whether the task's objects are found in images."""
        return self.task_settings.pose_estimator != "given" or bool(self.task_settings.object_models)

    @property
    def camera_documents(self) -> Sequence[JsonObject]:
        """The cameras as a request names them."""
        wanted = ("name", "intrinsics", "camera_to_world", "depth_scale")
        return [{name: camera.to_json()[name] for name in wanted} for camera in self.cameras]


def form_again(connection: Connection, prediction_id: str) -> PredictForm:
    """The question of a recorded prediction, the objects where they were found.

    Raises:
        NotFoundError: if there is no such prediction.
    """
    record = predictions.get(connection, prediction_id)
    form = form_of_task(connection, record.task, None)
    asked = {item["name"]: tuple(item.get("mask_ids", ())) for item in record.request.get("objects", ())}
    objects = tuple(ObjectField(item.name, item, asked.get(item.name, ())) for item in record.objects)
    settings = {name: record.request.get(name) for name in SETTINGS}
    return PredictForm(
        form.task,
        form.task_settings,
        record.instruction,
        objects or form.objects,
        record.cameras or form.cameras,
        form.instructions,
        form.episodes,
        None,
        record.id,
        {**settings, "model": record.model},
    )


def form_of_task(connection: Connection, name: str, episode_id: str | None) -> PredictForm:
    """The scene of an episode of the task, of its newest without an id.

    Raises:
        NotFoundError: if there is no such task or episode.
    """
    task = tasks.get(connection, name)
    listed = episodes.list_page(connection, name, NUM_EPISODES).items
    chosen = episodes.get(connection, episode_id) if episode_id else next(iter(listed), None)
    instruction, objects, cameras = "", tuple(ObjectField(each, None) for each in task.object_names or ()), ()
    if chosen is not None:
        instruction, objects = chosen.instruction, _objects(chosen)
    return PredictForm(
        task,
        TaskSettings.model_validate(task.settings),
        instruction,
        objects,
        cameras if chosen is None else chosen.cameras,
        episodes.instructions(connection, name),
        listed,
        chosen,
    )


def _objects(episode: EpisodeRecord) -> tuple[ObjectField, ...]:
    mask_ids = {item["name"]: tuple(item["mask_ids"]) for item in episode.given_objects}
    return tuple(ObjectField(item.name, item, mask_ids.get(item.name, ())) for item in episode.objects)


def image_digest(camera: CameraRecord, kind: ImageKind) -> str | None:
    """Where the camera's image of that kind is stored, if it has one."""
    return {"rgb": camera.rgb_digest, "depth": camera.depth_digest, "mask": camera.mask_digest}[kind]
