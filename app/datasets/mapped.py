"""One episode of a format that is a table of columns -> Recording, as the mapping and the user's options say."""

from collections.abc import Callable, Sequence

from app.datasets.columns import Columns, objects_of, trajectory_of
from app.datasets.mapping import FeatureMap
from app.datasets.options import ImportOptions
from app.datasets.recording import Recording
from app.pipeline.camera import Camera
from app.pipeline.errors import InvalidInputError
from app.pipeline.metadata import camera_from_json


def recording_of(
    *,
    name: str,
    source: str,
    task: str,
    instruction: str | None,
    columns: Columns,
    frequency_hz: float,
    mapping: FeatureMap,
    options: ImportOptions,
    image: Callable[[str], bytes],
    image_columns: Sequence[str] = (),
) -> Recording:
    """The recording.

    Args:
        name: of the episode in its dataset.
        source: the format, kept with the episode.
        task, instruction: what the dataset says; options go before.
        image: the encoded first image of a column; raises DamagedError.
        image_columns: those that have images, whether the mapping uses them or not.

    Raises:
        InvalidInputError: for a part that is missing or not as it must be.
    """
    if (said := options.instruction or instruction) is None:
        raise InvalidInputError("instruction", "the dataset names none", "--instruction 'what the robot does'")
    trajectory = trajectory_of(columns, mapping, frequency_hz)
    cameras, images = _cameras(mapping, options, image)
    used = {column for item in mapping.cameras for column in (item.rgb, item.depth)}
    unused = [column for column in image_columns if column not in used]
    derived = mapping.joint_velocities is None
    notes = [
        *(["joint velocities: derived from joint positions"] if derived else []),
        *([f"calibration of {', '.join(unused)}: images are left out"] if unused else []),
    ]
    return Recording(
        task=options.task or task,
        instruction=said,
        trajectory=trajectory,
        control_frequency_hz=frequency_hz,
        objects=objects_of(trajectory, mapping) or options.objects.of(name),
        cameras=cameras,
        images=images,
        extra={"source": source, "episode": name},
        notes=tuple(notes),
    )


def _cameras(
    mapping: FeatureMap, options: ImportOptions, image: Callable[[str], bytes]
) -> tuple[tuple[Camera, ...], dict[str, bytes]]:
    cameras, images = [], {}
    for item in mapping.cameras:
        if options.wants(item.name):
            cameras.append(camera_from_json(item.calibration))
            columns = {f"rgb_{item.name}": item.rgb, f"depth_{item.name}": item.depth}
            images.update({part: image(column) for part, column in columns.items() if column is not None})
    return tuple(cameras), images
