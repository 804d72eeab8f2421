"""An episode's first frame of a LeRobot camera: an embedded image, or the first picture of a video."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.errors import DamagedError, MissingPackageError
from app.datasets.images import rgb_png
from app.datasets.inside import read_inside
from app.datasets.lerobot_files import Info, Place, path_of
from app.datasets.limits import Budget
from app.datasets.parquet import read_value

# FFmpeg tells a container by its content, and some name other files or addresses to play: those are left out.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # of a frame's duration: the picture that is shown at a time begins within it


def first_image(root: Path, info: Info, place: Place, budget: Budget, feature: str) -> bytes:
    """The encoded first image of the episode.

    Raises:
        DamagedError: if it is not where it should be.
        MissingPackageError: for a video without the package that decodes it.
    """
    if feature not in info.features:
        raise DamagedError(root, f"has no images {feature}")
    if info.features[feature]["dtype"] == "image":
        return _embedded(root, place, feature, budget)
    path, start_s = _video(root, info, place, feature)
    return _first_picture(path, start_s, info.fps, budget)


def _embedded(root: Path, place: Place, feature: str, budget: Budget) -> bytes:
    value = read_value(place.data_file, feature, place.first_row or 0, budget)
    image: Mapping[str, Any] = value if isinstance(value, dict) else {}
    if image.get("bytes"):
        return bytes(image["bytes"])
    if image.get("path"):
        return read_inside(root, str(image["path"]), budget)
    raise DamagedError(place.data_file, f"{feature} has no image in row {place.first_row or 0}")


def _video(root: Path, info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """The video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(root / "meta/info.json", f"names no video_path for {feature}")
    if info.version == "v3.0":
        numbers = {f"{name}_index": place.row[f"videos/{feature}/{name}_index"] for name in ("chunk", "file")}
        path = path_of(root, info.video_path, video_key=feature, **numbers)
        return path, float(place.row[f"videos/{feature}/from_timestamp"])
    chunk = place.index // info.chunks_size
    return path_of(root, info.video_path, video_key=feature, episode_chunk=chunk, episode_index=place.index), 0.0


def _first_picture(path: Path, start_s: float, fps: float, budget: Budget) -> bytes:
    try:
        import av
    except ImportError as error:
        raise MissingPackageError("videos of LeRobot datasets", "av") from error
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
            budget.take(stream.width * stream.height * RGB_BYTES, path)
            if start_s > 0 and stream.time_base is not None:
                container.seek(int(start_s / stream.time_base), stream=stream)
            for picture in container.decode(stream):
                if picture.time is not None and picture.time >= start_s - NEAR_S / fps:
                    return rgb_png(np.asarray(picture.to_ndarray(format="rgb24"), np.uint8))
    except (OSError, ValueError, IndexError) as error:  # av's own errors are among both
        raise DamagedError(path, f"cannot be decoded: {error}") from error
    raise DamagedError(path, f"ends before {start_s:.3f} s")
