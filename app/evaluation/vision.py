"""Teaching and testing with images only: object models are learned first, from a few labelled scenes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from app.client.client import RoboPromptClient
from app.client.robot import Observation
from app.evaluation.errors import NotLearnedError
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.sim.demonstrate import RecordedDemonstration

FIRST_LABELLED_SEED = 50_000  # neither demonstrations nor tests are drawn from these
LABELLED_SCENES = 6
# The problems that say of an observation, not of the service, that it cannot be read.
UNSEEN = frozenset({"/problems/object-not-visible", "/problems/uncertain-pose"})


def images_only(frames: Sequence[RgbdFrame], objects: Sequence[ObjectPose]) -> Observation:
    """What cameras show of the objects: no poses, no masks."""
    return Observation((), tuple(replace(frame, mask=None) for frame in frames), tuple(pose.name for pose in objects))


def learned_models(client: RoboPromptClient, name: str, labelled: Sequence[RecordedDemonstration]) -> Mapping[str, Any]:
    """Models of every object, learned by the service from the scenes' masks and poses.

    Args:
        name: of the task that is to find objects by them; the labelled scenes come under a name of their own.

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
