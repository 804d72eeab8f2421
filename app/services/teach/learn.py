"""Object models: learned from a task's episodes or labels, and tried out before the task is given them.

Synchronous: call it in a thread.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.perception.base import LabeledScene, ObjectQuery
from app.perception.cuboid.learn import learn_models
from app.perception.models import model_from_json
from app.perception.object_model import ObjectModelError
from app.perception.registered.learn import LabeledView, Learned, learn
from app.perception.registered.model import LeftOutView, RegisteredModel, yaw_symmetry_deg
from app.perception.registry import estimate_poses
from app.services.errors import NoDemonstrationsError
from app.services.images import read_frame
from app.services.poses import PoseServers, with_template
from app.services.teach.configure import ConfigureTask
from app.store import episodes, labels, tasks
from app.store.errors import NotFoundError
from app.store.labels import LabelRecord
from app.store.records import EpisodeRecord, TaskRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

MAX_VIEWS = 10  # labeled, that an object is learned from


@dataclass(frozen=True)
class LearnedModels:
    """The learned models, and the reasons why others were not learned.

    Attributes:
        object_models: by object, as the task now has them.
        refused: by object, why nothing was learned of it.
        episode_ids: from which was learned.
    """

    object_models: Mapping[str, Mapping[str, Any]]
    refused: Mapping[str, InvalidInputError]
    episode_ids: tuple[str, ...]


def learn_object_models(
    store: Store, configure_task: ConfigureTask, name: str, objects: Sequence[str] | None, max_episodes: int
) -> LearnedModels:
    """Learn models for the estimator `cuboid` from labeled episodes: masks, poses or both beside RGB-D images.

    They are added to the task's `object_models`, and every episode is extracted again.

    Args:
        objects: to be learned; None for all of the task.
        max_episodes: the task's first ones with labels and images.

    Raises:
        NotFoundError, NoDemonstrationsError: if there is no such task, or nothing in it.
        InvalidInputError: if no episode has labels and images, or one cannot be extracted with what was learned;
            nothing is changed.
        ConflictError: if the task changed meanwhile.
    """
    with store.read() as connection:
        task = tasks.get(connection, name)
        wanted = _wanted(task, objects)
        records = [record for record in episodes.all_of(connection, name) if _labeled(record, wanted)]
    if not records:
        message = f"none of the task {name!r} has RGB-D images with labels of {', '.join(wanted)}"
        raise InvalidInputError("episodes", message, "rgb_NAME, depth_NAME, and mask_ids or a position per object")
    chosen = records[:max_episodes]
    symmetries = task.settings.get("yaw_symmetry_deg", {})
    learned, refused = _learned([_scene(store, record, wanted) for record in chosen], wanted, symmetries)
    if learned:
        configure_task(name, {}, learned)
    return LearnedModels(learned, refused, tuple(record.id for record in chosen))


def _scene(store: Store, record: EpisodeRecord, wanted: Sequence[str]) -> LabeledScene:
    frames = tuple(read_frame(store.blobs, camera) for camera in record.cameras)
    queries = {query.name: query for query in map(ObjectQuery.from_json, record.given_objects)}
    return LabeledScene(frames, tuple(queries[name] for name in wanted))


def _wanted(task: TaskRecord, objects: Sequence[str] | None) -> tuple[str, ...]:
    if task.object_names is None:
        raise NoDemonstrationsError(task.name)
    if objects is None:
        return task.object_names
    for name in objects:
        if name not in task.object_names:
            raise InvalidInputError("objects", f"{name!r} is no object of the task", ", ".join(task.object_names))
    return tuple(dict.fromkeys(objects))


def _labeled(record: EpisodeRecord, wanted: Sequence[str]) -> bool:
    given = {item["name"]: item for item in record.given_objects}
    has_images = any(camera.has_rgbd for camera in record.cameras)
    return has_images and all(given[name]["mask_ids"] or given[name]["position_m"] is not None for name in wanted)


def _learned(
    scenes: Sequence[LabeledScene], wanted: Sequence[str], yaw_symmetry_deg: Mapping[str, float]
) -> tuple[dict[str, dict[str, Any]], dict[str, InvalidInputError]]:
    """Models of the objects that can be learned without those that cannot, and why these cannot."""
    refused: dict[str, InvalidInputError] = {}
    while names := [name for name in wanted if name not in refused]:
        try:
            models = learn_models([_only(scene, names) for scene in scenes], yaw_symmetry_deg)
        except ObjectModelError as error:
            refused[error.name] = error
        else:
            return {name: model.as_json() for name, model in models.items()}, refused
    return {}, refused


def _only(scene: LabeledScene, names: Sequence[str]) -> LabeledScene:
    return replace(scene, objects=tuple(query for query in scene.objects if query.name in names))


def learn_from_labels(
    store: Store,
    configure_task: ConfigureTask,
    task: str,
    name: str,
    symmetric: str | float,
    *,
    yaw_may_be_unknown: bool = False,
    dry_run: bool = False,
) -> Mapping[str, Any]:
    """Learn a model of an object for the estimator `registered` from its last labels; return the model.

    The task has it from now on, and every episode is extracted again.

    Args:
        dry_run: leave the task as it is.

    Raises:
        NotFoundError: if there is no such task.
        InvalidInputError: if the object has no labels, no template can be learned from them, or an episode cannot
            be extracted with it; nothing is changed.
        ConflictError: if the task changed meanwhile.
    """
    symmetry_deg = yaw_symmetry_deg(symmetric)
    with store.read() as connection:
        tasks.get(connection, task)
        records = labels.all_of(connection, task, name)[-MAX_VIEWS:]
    if not records:
        raise ObjectModelError(
            name, "has no labels", f"POST /tasks/{task}/labels with its mask in 1 to {MAX_VIEWS} views"
        )
    views = [_view(store, record) for record in records]
    learned = learn(name, views, symmetry_deg, needs_yaw=not yaw_may_be_unknown)
    template = store.blobs.put(learned.template.to_bytes())
    symmetry = symmetric if symmetric in ("none", "yaw") else float(symmetric)
    ids = [record.id for record in records]
    model = _with_views(RegisteredModel(template, symmetry, yaw_may_be_unknown), learned, ids).as_json()
    if not dry_run:
        configure_task(task, {}, learned={name: model})
    return model


def _with_views(model: RegisteredModel, learned: Learned, ids: Sequence[str]) -> RegisteredModel:
    """Return the model with what is known of its views, whose labels have these ids."""
    return replace(
        model,
        views=tuple(ids[number] for number in learned.merged),
        scores=tuple(round(score, 3) for score in learned.template.scores),
        left_out=tuple(LeftOutView(ids[number], reason) for number, reason in learned.refused.items()),
        num_points=len(learned.template),
    )


def _view(store: Store, record: LabelRecord) -> LabeledView:
    return LabeledView(tuple(read_frame(store.blobs, camera) for camera in record.cameras), record.yaw_deg)


@dataclass(frozen=True, eq=False)
class Tried:
    """The pose that a model finds in an episode; all None if the episode has no images.

    Attributes:
        refusal: why the object is not found.
    """

    episode_id: str
    pose: ObjectPose | None = None
    refusal: InvalidInputError | None = None


def try_model(
    store: Store, pose_servers: PoseServers, task: str, name: str, model: Mapping[str, Any], ids: Sequence[str]
) -> tuple[Tried, ...]:
    """Return what an object model makes of each episode, in their order; nothing is stored.

    Raises:
        NotFoundError: if there is no such task, or it has no such episode.
        InvalidInputError: if the model is not valid, or its template is not stored.
    """
    with store.read() as connection:
        tasks.get(connection, task)
        records = episodes.by_ids(connection, task, ids)
    if missing := [id_ for id_ in ids if id_ not in records]:
        raise NotFoundError(f"episode of task {task!r}", missing[0])
    query = ObjectQuery(name, model=model_from_json(name, model, "model"))
    pose_servers.check({name: model})
    query = with_template(query, store.blobs)
    return tuple(_tried(store, record, query) for record in records.values())


def _tried(store: Store, record: EpisodeRecord, query: ObjectQuery) -> Tried:
    if not any(camera.has_rgbd for camera in record.cameras):
        return Tried(record.id)
    frames = [read_frame(store.blobs, camera) for camera in record.cameras]
    try:
        (pose,) = estimate_poses("", [query], frames)
    except InvalidInputError as refusal:
        return Tried(record.id, refusal=refusal)
    return Tried(record.id, pose)
