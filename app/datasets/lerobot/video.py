"""Reads first pictures from the videos of a LeRobot dataset, by PyAV."""

from pathlib import Path

import numpy as np

from app.datasets.bounds import Budget, DamagedError, MissingPackageError
from app.datasets.lerobot.files import Info, Place, path_of
from app.datasets.parcel import rgb_png

# FFmpeg detects containers by content, and some refer to other files or addresses: those are not allowed.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # tolerance for the time of a picture, in frame durations


def first_picture(info: Info, place: Place, feature: str, budget: Budget) -> bytes:
    """Return an episode's first picture as a PNG; raises DamagedError, or MissingPackageError without av."""
    try:
        import av
    except ImportError as error:
        raise MissingPackageError("videos of LeRobot datasets", "av") from error
    path, start_s = _location(info, place, feature)
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
            budget.take(stream.width * stream.height * RGB_BYTES, path)
            if start_s > 0 and stream.time_base is not None:
                container.seek(int(start_s / stream.time_base), stream=stream)
            for picture in container.decode(stream):
                if picture.time is not None and picture.time >= start_s - NEAR_S / info.fps:
                    return rgb_png(np.asarray(picture.to_ndarray(format="rgb24"), np.uint8))
    except (OSError, ValueError, IndexError) as error:  # av's own errors are among both
        raise DamagedError(path, f"cannot be decoded: {error}") from error
    raise DamagedError(path, f"ends before {start_s:.3f} s")


def _location(info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """Return the video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(info.root / "meta/info.json", f"names no video_path for {feature}")
    try:
        numbers = {f"{name}_index": int(place.row[f"videos/{feature}/{name}_index"]) for name in ("chunk", "file")}
        start_s = float(place.row[f"videos/{feature}/from_timestamp"])
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedError(info.root / "meta/episodes", f"does not say where {feature} is: {error!r}") from error
    return path_of(info.root, info.video_path, video_key=feature, **numbers), start_s
