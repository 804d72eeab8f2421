"""Record demonstrations with a task's expert and upload them, under a task name for each way of reading them.

With images only, object models are learned first, from a few labeled scenes.
"""

import json
import re
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.failures import ExpertFailedError, NotLearnedError
from app.evaluation.methods import Method
from app.evaluation.paper import disturbed
from app.evaluation.world import World
from app.executors import Executor
from app.pipeline.geometry import yaw_rad
from app.sim.outcomes import RecordedDemonstration, SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

FIRST_LABELED_SEED = 50_000  # neither demonstrations nor tests are drawn from these
LABELED_SCENES = 6
# The problems that say of an observation, not of the service, that it cannot be read.
UNSEEN = frozenset({"/problems/object-not-visible", "/problems/uncertain-pose"})
MAX_FAILED_SHARE = 0.5
MAX_SLUG_CHARS = 20


def images_only(frames: Sequence[RgbdFrame], objects: Sequence[ObjectPose]) -> Observation:
    """What cameras show of the objects: no poses, no masks."""
    return Observation((), tuple(replace(frame, mask=None) for frame in frames), tuple(pose.name for pose in objects))


def learned_models(
    client: RoboPromptClient,
    name: str,
    labeled: Sequence[RecordedDemonstration],
    yaw_symmetry_deg: Mapping[str, float],
) -> dict[str, Any]:
    """Models of every object: a box or cylinder where the service learns one, else what it looked like in the scenes.

    Args:
        name: of the task that is to find objects by them; the labeled scenes come under a name of their own.
        yaw_symmetry_deg: of the objects, as for `PUT /tasks/{name}`.

    Raises:
        NotLearnedError: if an object cannot be learned; says why.
        ServiceProblemError, ServiceUnreachableError.
    """
    school = f"{name}.labels"
    client.configure_task(school, yaw_symmetry_deg=dict(yaw_symmetry_deg))
    episodes = []
    for item in labeled:
        seen = Observation(item.scene.objects, item.scene.frames)
        document = _upload(client, school, item, seen, mask_ids=item.scene.mask_ids)
        episodes.append((str(document["id"]), item.scene))
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
    """What an object looks like, from its mask and an arrow in each episode, as a person would draw them.

    The arrow points away from the robot in the first one, is good to ten degrees, and a symmetry that was not known is
    found out by what the service says.
    """
    yaws_deg = [next(_yaw_deg(pose) for pose in scene.objects if pose.name == name) for _, scene in episodes]
    ahead_deg = 90 * round(yaws_deg[0] / 90)
    for (id_, scene), yaw_deg in zip(episodes, yaws_deg, strict=True):
        arrow: dict[str, Any] = {} if symmetry_deg == 0 else {"yaw_deg": 10.0 * round((yaw_deg - ahead_deg) / 10)}
        # Parts that a joint connects to it are not labeled: an object is rigid.
        client.label_object(school, name, id_, mask_ids=scene.mask_ids[name][:1], **arrow)
    known: str | float = "none" if symmetry_deg is None else symmetry_deg or "yaw"
    reasons = []
    for symmetric in dict.fromkeys((known, "none", 180.0)):
        try:
            model: Mapping[str, Any] = client.learn_from_labels(school, name, symmetric)["model"]
        except ServiceProblemError as error:
            reasons.append(f"symmetric {symmetric}: {error}")
        else:
            return model
    raise NotLearnedError(f"{name} cannot be found in images: {'; '.join(reasons)}")


def _yaw_deg(pose: ObjectPose) -> float:
    return float(np.degrees(yaw_rad(Rotation.from_quat(pose.quaternion_xyzw))))


@dataclass(frozen=True, eq=False)
class TaughtEpisode:
    """A demonstration, without its images, with the service's description of it (`POST /episodes`)."""

    recorded: RecordedDemonstration
    document: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Lesson:
    """Demonstrations as some methods are taught them.

    Attributes:
        name: of the task at the service.
        num_demonstrations: what a prompt has by default; there may be more.
    """

    name: str
    num_demonstrations: int
    taught: tuple[TaughtEpisode, ...]


def variants(methods: Sequence[Method]) -> dict[str, Method]:
    """What has to be taught, by the suffix of its task name: the first of the methods that need it.

    Methods with given poses and without settings and noise of their own share the suffix ``""``, which is always there.
    """
    found = {_variant(Method("")): ("", Method(""))}
    for method in methods:
        slug = re.sub(r"[^A-Za-z0-9]+", "-", method.label)[:MAX_SLUG_CHARS].strip("-")
        found.setdefault(_variant(method), (f".{len(found)}-{slug}", method))
    return dict(found.values())


def suffix_of(method: Method, methods: Sequence[Method]) -> str:
    """The suffix among `variants(methods)` under which `method` is taught."""
    return next(suffix for suffix, first in variants(methods).items() if _variant(first) == _variant(method))


def _variant(method: Method) -> str:
    taught = [method.settings, method.taught_noise, method.source == "closed loop", method.poses]
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
    """`number` successful demonstrations, in the order of their seeds; a failed one is replaced by a further seed's.

    Args:
        unseen: seeds that no demonstration may be drawn from.
        on_done: called after each.

    Raises:
        ExpertFailedError: if more than half of the expert's attempts fail.
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
            raise ExpertFailedError(f"the expert of {task} failed {failed} times, last: {attempt.failure}")
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
    """Set the task `name` up as `method` wants it, and upload the demonstrations in their order.

    Args:
        settings: of the task.
        labeled: from which object models are learned if `method` finds poses in images.

    Raises:
        NotLearnedError: if that cannot be.
        ServiceProblemError, ServiceUnreachableError.
    """
    if method.poses == "vision":
        settings = with_models(settings, learned_models(client, name, labeled, settings["yaw_symmetry_deg"]))
    client.configure_task(name, **settings)
    taught = tuple(_taught(client, name, recorded, method))
    return Lesson(name, settings["num_demonstrations"], taught)


def with_models(settings: Mapping[str, Any], models: Mapping[str, Any]) -> dict[str, Any]:
    """A task's settings with object models; how symmetric an object is that has labels, these say."""
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
    """The demonstrations that the service takes; of those with images only, some may show too little.

    Raises:
        NotLearnedError: if more than half show too little.
    """
    refused = []
    for item in shown:
        scene, tracked = item.scene, method.source == "closed loop"
        seen = Observation(disturbed(scene.objects, method.taught_noise, scene.seed), scene.frames)
        if method.poses == "vision":
            seen = images_only(scene.frames, scene.objects)
        try:
            document = _upload(client, name, item, seen, tracked=tracked)
            yield TaughtEpisode(replace(item, scene=replace(scene, frames=())), document)
        except ServiceProblemError as error:
            if method.poses != "vision" or error.problem.get("type") not in UNSEEN:
                raise
            refused.append(str(error))
    if len(refused) > MAX_FAILED_SHARE * len(shown):
        raise NotLearnedError(f"{len(refused)} of {len(shown)} demonstrations show too little: {refused[0]}")


def _upload(
    client: RoboPromptClient,
    name: str,
    recorded: RecordedDemonstration,
    seen: Observation,
    *,
    tracked: bool = False,
    mask_ids: Mapping[str, Sequence[int]] | None = None,
) -> dict[str, Any]:
    trajectory = recorded.trajectory
    if not tracked:
        trajectory = replace(trajectory, object_positions_m=None, object_quaternions_xyzw=None)
    return client.upload(
        name,
        recorded.scene.instruction,
        trajectory,
        seen,
        control_frequency_hz=recorded.control_frequency_hz,
        mask_ids=mask_ids,
        extra={"seed": recorded.scene.seed, "simulator": "mujoco"},
    )
