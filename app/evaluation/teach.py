"""Records demonstrations with a task's expert and uploads them, once for each group of methods with equal settings.

For methods that see images only, object models are learned first, from a few labeled scenes.
"""

import json
import re
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from app.evaluation.methods import Method
from app.evaluation.paper import disturbed
from app.evaluation.world import World
from app.executors import Executor
from app.pipeline.episode import rotation_of
from app.sim.outcomes import RecordedDemonstration, SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import RoboPromptError, ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.quaternions import yaw_rad

FIRST_LABELED_SEED = 50_000  # not used by demonstrations or tests
LABELED_SCENES = 6
# Problem types that mean that an object was not found in the images.
UNSEEN = frozenset({"/problems/object-not-visible", "/problems/uncertain-pose"})
MAX_FAILED_SHARE = 0.5
MAX_SLUG_CHARS = 20


class TeachingError(RoboPromptError):
    """A task's expert fails too often, or objects cannot be found in images; the message says which and why."""


def images_only(frames: Sequence[RgbdFrame], objects: Sequence[ObjectPose]) -> Observation:
    """Return an observation of images without poses and masks."""
    return Observation((), tuple(replace(frame, mask=None) for frame in frames), tuple(pose.name for pose in objects))


def _learned_models(
    client: RoboPromptClient,
    name: str,
    labeled: Sequence[RecordedDemonstration],
    yaw_symmetry_deg: Mapping[str, float],
) -> dict[str, Any]:
    """Return a model of every object: a box or cylinder if the service learns one, else a `registered` model.

    Args:
        name: of the task that will use the models; the labeled scenes are uploaded to another task.
        yaw_symmetry_deg: of the objects, as for `PUT /tasks/{name}`.

    Raises:
        TeachingError: if an object cannot be learned; with the reason.
        ServiceProblemError, ServiceUnreachableError.
    """
    school = f"{name}.labels"
    client.configure_task(school, yaw_symmetry_deg=dict(yaw_symmetry_deg))
    episodes = []
    for item in labeled:
        seen = Observation(item.scene.objects, item.scene.frames, mask_ids=item.scene.mask_ids)
        episodes.append((_upload(client, school, item, seen), item.scene))
    learned = client.learn_object_models(school, episodes=len(labeled))
    models = dict(learned["object_models"])
    for missing in learned["refused"]:
        models[missing] = _model_from_labels(client, school, missing, episodes, yaw_symmetry_deg.get(missing))
    return models


def _model_from_labels(
    client: RoboPromptClient,
    school: str,
    name: str,
    episodes: Sequence[tuple[str, SceneView]],
    symmetry_deg: float | None,
) -> Mapping[str, Any]:
    """Return a `registered` model, learned from the object's mask and an arrow in each episode, as a person labels.

    The arrow points away from the robot in the first episode and is accurate to ten degrees. An unknown symmetry is
    tried out.
    """
    poses = [next(pose for pose in scene.objects if pose.name == name) for _, scene in episodes]
    yaws_deg = [float(np.degrees(yaw_rad(rotation_of(pose)))) for pose in poses]
    ahead_deg = 90 * round(yaws_deg[0] / 90)
    for (id_, scene), yaw_deg in zip(episodes, yaws_deg, strict=True):
        arrow: dict[str, Any] = {} if symmetry_deg == 0 else {"yaw_deg": 10.0 * round((yaw_deg - ahead_deg) / 10)}
        # Parts that a joint connects to it are not labeled: an object is rigid.
        client.label_object(school, name, id_, mask_ids=scene.mask_ids[name][:1], **arrow)
    known: str | float = "none" if symmetry_deg is None else symmetry_deg or "yaw"
    reasons = []
    for symmetric in dict.fromkeys((known, "none", 180.0, 90.0, "yaw")):
        try:
            model: Mapping[str, Any] = client.learn_from_labels(school, name, symmetric)["model"]
        except ServiceProblemError as error:
            reasons.append(f"symmetric {symmetric}: {error}")
        else:
            return model
    raise TeachingError(f"{name} cannot be found in images: {'; '.join(reasons)}")


@dataclass(frozen=True, eq=False)
class TaughtEpisode:
    """A demonstration without its images, and its id at the service."""

    recorded: RecordedDemonstration
    episode_id: str


@dataclass(frozen=True, eq=False)
class Lesson:
    """The demonstrations of a group of methods, and the name of the task at the service."""

    name: str
    taught: tuple[TaughtEpisode, ...]


def variants(methods: Sequence[Method]) -> dict[str, Method]:
    """Return, by suffix of a task's name, the first method of each group that is taught together.

    Methods with given poses and without own settings and noise have the suffix ``""``, which always exists.
    """
    found = {_variant(Method("")): ("", Method(""))}
    for method in methods:
        slug = re.sub(r"[^A-Za-z0-9]+", "-", method.label)[:MAX_SLUG_CHARS].strip("-")
        found.setdefault(_variant(method), (f".{len(found)}-{slug}", method))
    return dict(found.values())


def suffix_of(method: Method, methods: Sequence[Method]) -> str:
    """Return the suffix in `variants(methods)` of the group of `method`."""
    return next(suffix for suffix, first in variants(methods).items() if _variant(first) == _variant(method))


def _variant(method: Method) -> str:
    taught = [method.settings, method.noise, method.poses]
    return json.dumps(taught, sort_keys=True)


def record(
    executor: Executor,
    world: World,
    task: str,
    number: int,
    *,
    images: bool,
    unseen: Collection[int] = (),
    on_done: Callable[[], None] = lambda: None,
    first_seed: int = 0,
) -> tuple[RecordedDemonstration, ...]:
    """Return `number` successful demonstrations in the order of their seeds; failed ones are replaced by further seeds.

    Args:
        unseen: seeds that demonstrations must not use.
        on_done: called after each success.

    Raises:
        TeachingError: if more than half of the expert's attempts fail.
    """
    seeds = (seed for seed in count(first_seed) if seed not in unseen)
    pending = deque(executor.submit(world.demonstrate, task, next(seeds), images) for _ in range(number))
    recorded: list[RecordedDemonstration] = []
    failed = 0
    while pending:
        attempt = pending.popleft().result()
        if attempt.succeeded:
            recorded.append(attempt)
            on_done()
            continue
        failed += 1
        if failed > MAX_FAILED_SHARE * number + 1:
            raise TeachingError(f"the expert of {task} failed {failed} times, last: {attempt.failure}")
        pending.append(executor.submit(world.demonstrate, task, next(seeds), images))
    return tuple(recorded)


def upload(
    client: RoboPromptClient,
    name: str,
    recorded: Sequence[RecordedDemonstration],
    method: Method,
    settings: Mapping[str, Any],
    labeled: Sequence[RecordedDemonstration] = (),
) -> Lesson:
    """Configure the task `name` for `method`, and upload the demonstrations in their order.

    Args:
        settings: of the task.
        labeled: scenes from which object models are learned if `method` finds poses in images.

    Raises:
        TeachingError: if objects cannot be learned.
        ServiceProblemError, ServiceUnreachableError.
    """
    if method.poses == "vision":
        settings = with_object_models(settings, _learned_models(client, name, labeled, settings["yaw_symmetry_deg"]))
    client.configure_task(name, **settings)
    return Lesson(name, tuple(_taught(client, name, recorded, method)))


def with_object_models(settings: Mapping[str, Any], models: Mapping[str, Any]) -> dict[str, Any]:
    """Return a task's settings with object models; `registered` models decide their objects' symmetry."""
    symmetries = dict(settings["yaw_symmetry_deg"])
    for name, model in models.items():
        if model["estimator"] == "registered":
            symmetries.pop(name, None)
            if model["symmetric"] != "none":
                symmetries[name] = 0.0 if model["symmetric"] == "yaw" else model["symmetric"]
    return {**settings, "yaw_symmetry_deg": symmetries, "object_models": models}


def _taught(
    client: RoboPromptClient, name: str, shown: Sequence[RecordedDemonstration], method: Method
) -> Iterator[TaughtEpisode]:
    """Yield the uploaded demonstrations; those in whose images the service does not find an object are left out.

    Raises:
        TeachingError: if more than half are left out.
    """
    refused = []
    for item in shown:
        scene = item.scene
        seen = Observation(disturbed(scene.objects, method.noise, scene.seed), scene.frames)
        if method.poses == "vision":
            seen = images_only(scene.frames, scene.objects)
        try:
            episode_id = _upload(client, name, item, seen)
            yield TaughtEpisode(replace(item, scene=replace(scene, frames=())), episode_id)
        except ServiceProblemError as error:
            if method.poses != "vision" or error.problem.get("type") not in UNSEEN:
                raise
            refused.append(str(error))
    if len(refused) > MAX_FAILED_SHARE * len(shown):
        raise TeachingError(f"{len(refused)} of {len(shown)} demonstrations show too little: {refused[0]}")


def _upload(client: RoboPromptClient, name: str, recorded: RecordedDemonstration, seen: Observation) -> str:
    """Upload a demonstration; return its id at the service."""
    document = client.upload(
        name,
        recorded.scene.instruction,
        replace(recorded.trajectory, object_positions_m=None, object_quaternions_xyzw=None),
        seen,
        control_frequency_hz=recorded.control_frequency_hz,
        extra={"seed": recorded.scene.seed, "simulator": "mujoco"},
    )
    return str(document["id"])
