"""Record demonstrations with a task's expert and upload them, under a task name for each way of reading them.

With images only, object models are learned first, from a few labeled scenes.
"""

import json
import re
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from app.evaluation.failures import ExpertFailedError, NotLearnedError
from app.evaluation.methods import Method
from app.evaluation.paper import disturbed
from app.evaluation.results import TaughtEpisode
from app.evaluation.world import World
from app.executors import Executor
from app.sim.outcomes import RecordedDemonstration
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import ObjectPose

FIRST_LABELLED_SEED = 50_000  # neither demonstrations nor tests are drawn from these
LABELLED_SCENES = 6
# The problems that say of an observation, not of the service, that it cannot be read.
UNSEEN = frozenset({"/problems/object-not-visible", "/problems/uncertain-pose"})
MAX_FAILED_SHARE = 0.5
MAX_SLUG_CHARS = 20


def images_only(frames: Sequence[RgbdFrame], objects: Sequence[ObjectPose]) -> Observation:
    """What cameras show of the objects: no poses, no masks."""
    return Observation((), tuple(replace(frame, mask=None) for frame in frames), tuple(pose.name for pose in objects))


def learned_models(client: RoboPromptClient, name: str, labelled: Sequence[RecordedDemonstration]) -> Mapping[str, Any]:
    """Models of every object, learned by the service from the scenes' masks and poses.

    Args:
        name: of the task that is to find objects by them; the labeled scenes come under a name of their own.

    Raises:
        NotLearnedError: if an object cannot be learned; says why.
        ServiceProblemError, ServiceUnreachableError.
    """
    school = f"{name}.labels"
    for item in labelled:
        seen = Observation(item.scene.objects, item.scene.frames)
        trajectory = replace(item.trajectory, object_positions_m=None, object_quaternions_xyzw=None)
        client.upload(
            school,
            item.scene.instruction,
            trajectory,
            seen,
            control_frequency_hz=item.control_frequency_hz,
            mask_ids=item.scene.mask_ids,
            extra={"seed": item.scene.seed, "simulator": "mujoco"},
        )
    learned = client.learn_object_models(school, episodes=len(labelled))
    if learned["refused"]:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in learned["refused"].items())
        raise NotLearnedError(f"not all objects can be found in images: {reasons}")
    models: Mapping[str, Any] = learned["object_models"]
    return models


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

    def without_images(self) -> "Lesson":
        """The same without the frames, which are large."""
        return replace(self, taught=tuple(map(_without_images, self.taught)))


def _without_images(taught: TaughtEpisode) -> TaughtEpisode:
    scene = replace(taught.recorded.scene, frames=())
    return replace(taught, recorded=replace(taught.recorded, scene=scene))


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
    labelled: Sequence[RecordedDemonstration] = (),
) -> Lesson:
    """Set the task `name` up as `method` wants it, and upload the demonstrations in their order.

    Args:
        settings: of the task.
        labelled: from which object models are learned if `method` finds poses in images.

    Raises:
        NotLearnedError: if that cannot be.
        ServiceProblemError, ServiceUnreachableError.
    """
    if method.poses == "vision":
        settings = {**settings, "object_models": learned_models(client, name, labelled)}
    client.configure_task(name, **settings)
    taught = tuple(TaughtEpisode(item, _upload(client, name, item, method)) for item in recorded)
    return Lesson(name, settings["num_demonstrations"], taught)


def _upload(client: RoboPromptClient, name: str, recorded: RecordedDemonstration, method: Method) -> dict[str, object]:
    scene, trajectory = recorded.scene, recorded.trajectory
    if method.source != "closed loop":
        trajectory = replace(trajectory, object_positions_m=None, object_quaternions_xyzw=None)
    seen = Observation(disturbed(scene.objects, method.taught_noise, scene.seed), scene.frames)
    if method.poses == "vision":
        seen = images_only(scene.frames, scene.objects)
    return client.upload(
        name,
        scene.instruction,
        trajectory,
        seen,
        control_frequency_hz=recorded.control_frequency_hz,
        extra={"seed": scene.seed, "simulator": "mujoco"},
    )
