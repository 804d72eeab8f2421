"""What a task's settings make of its episodes: keyframes and object poses."""

from collections.abc import Iterable, Sequence

from app.perception.base import ObjectQuery
from app.pipeline.findings.frames import GIVEN
from app.pipeline.keyframes import Motion, find_keyframes
from app.services.images import read_frame
from app.services.poses import poses_of
from app.services.task_settings import TaskSettings
from app.store.blobs import BlobStore
from app.store.errors import NotFoundError
from app.store.records import EpisodeRecord, Extraction
from app.store.store import Store
from app.store.trajectories import get_trajectory
from app.store.values import KeyframeRecord, ObjectRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.trajectory import Trajectory


def extract(
    motion: Motion,
    objects: Iterable[ObjectQuery],
    frames: Sequence[RgbdFrame],
    settings: TaskSettings,
    names: Sequence[str],
    blobs: BlobStore,
) -> tuple[tuple[KeyframeRecord, ...], tuple[ObjectRecord, ...]]:
    """Return the keyframes, and the objects' poses at the first frame in the task's order.

    Args:
        motion: as the settings read it.
        names: of the objects, in the task's order.
        blobs: where templates of the objects are.

    Raises:
        InvalidInputError: if there is no keyframe, or an object cannot be found.
    """
    rule, trajectory = settings.keyframes.keyframe_rule(), motion.trajectory
    keyframes = tuple(
        KeyframeRecord.of(frame, trajectory.action_at(frame, gripper_open=gripper_open))
        for frame, gripper_open in find_keyframes(motion, rule)
    )
    if not keyframes:
        message = f"no keyframe in {len(trajectory)} frames by rule {rule.rule!r}"
        raise InvalidInputError("trajectory", message, "an episode in which the robot moves and then rests")
    has_rgbd = any(frame.rgb is not None and frame.depth_m is not None for frame in frames)
    poses = poses_of(objects, settings, frames, blobs, given_first=not has_rgbd)
    return keyframes, tuple(map(ObjectRecord.of, sorted(poses, key=lambda pose: names.index(pose.name))))


def extract_again(
    store: Store, record: EpisodeRecord, settings: TaskSettings, trajectory: Trajectory | None = None
) -> Extraction:
    """A stored episode's keyframes and poses as `settings` want them.

    Args:
        trajectory: None: the stored one.

    Raises:
        InvalidInputError: naming the episode and why it cannot be extracted so.
        CorruptDataError: if what is stored of it is damaged.
        NotFoundError: if it was deleted since.
    """
    if trajectory is None:
        with store.read() as connection:
            trajectory = get_trajectory(connection, record.id)
    try:
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        given, names = map(ObjectQuery.from_json, record.given_objects), [item.name for item in record.objects]
        looks = settings.pose_estimator != GIVEN or not settings.object_models.keys().isdisjoint(names)
        frames = [read_frame(store.blobs, item) for item in record.cameras] if looks else []
        return Extraction(record.id, *extract(motion, given, frames, settings, names, store.blobs))
    except InvalidInputError as error:
        raise InvalidInputError(f"episode {record.id}: {error.field}", error.message, error.valid) from error


def extract_all_again(store: Store, records: Sequence[EpisodeRecord], settings: TaskSettings) -> list[Extraction]:
    """Several stored episodes, each as by `extract_again`.

    One that is left out of prompts stays as it is if that fails; one that was deleted since is missing.
    """
    extractions = []
    for record in records:
        try:
            extractions.append(extract_again(store, record, settings))
        except InvalidInputError:
            if not record.left_out:
                raise
            extractions.append(Extraction(record.id, record.keyframes, record.objects))
        except NotFoundError:
            continue
    return extractions
