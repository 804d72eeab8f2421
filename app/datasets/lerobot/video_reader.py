"""Reads first pictures and films from the videos of a LeRobot dataset, by PyAV.

A dataset has a picture for each row of its data; a film keeps as many a second as the client takes.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import Budget, DamagedError, MissingPackageError
from app.datasets.lerobot.files import Info, Place, path_of
from app.datasets.parcel import rgb_png
from roboprompt_client.encoding import film_jpeg
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import FILM_HZ, MAX_PICTURES, Film

KEY = "observation.images."
# FFmpeg detects containers by content, and some refer to other files or addresses: those are not allowed.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # tolerance for the time of a picture, in frame durations


def first_picture(root: Path, info: Info, place: Place, feature: str, budget: Budget) -> bytes:
    """Return an episode's first picture as a PNG; raises DamagedError, or MissingPackageError without av."""
    _, picture = next(_pictures(*_location(root, info, place, feature), info.fps, budget))
    return rgb_png(_rgb(picture))


def film_from_video(
    root: Path, info: Info, place: Place, feature: str, camera: str, times_s: Array, budget: Budget
) -> Film:
    """Return an episode's video as a film.

    Args:
        times_s: (T,) of the episode's rows.

    Raises:
        DamagedError, MissingPackageError: as `first_picture`.
        InvalidInputError: if it is larger than a film may be.
    """
    path, start_s = _location(root, info, place, feature)
    kept: list[tuple[float, bytes]] = []
    due_s = -np.inf
    for time_s, picture in _pictures(path, start_s, info.fps, budget):
        if (row := round((time_s - start_s) * info.fps)) >= len(times_s):
            break
        if times_s[row] >= due_s:
            data = film_jpeg(cv2, _rgb(picture))
            budget.take(len(data), path)
            kept.append((float(times_s[row]), data))
            if len(kept) > MAX_PICTURES:  # the rest need not be decoded
                break
            due_s = times_s[row] + 1 / FILM_HZ - NEAR_S / info.fps
    return Film(camera, np.array([time_s for time_s, _ in kept]), tuple(data for _, data in kept))


def _location(root: Path, info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """Return the video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(root / "meta/info.json", f"names no video_path for {feature}")
    if info.version == "v3.0":
        try:
            numbers = {f"{name}_index": int(place.row[f"videos/{feature}/{name}_index"]) for name in ("chunk", "file")}
            start_s = float(place.row[f"videos/{feature}/from_timestamp"])
        except (KeyError, TypeError, ValueError) as error:
            raise DamagedError(root / "meta/episodes", f"does not say where {feature} is: {error!r}") from error
        return path_of(root, info.video_path, video_key=feature, **numbers), start_s
    chunk = place.index // info.chunks_size
    return path_of(root, info.video_path, video_key=feature, episode_chunk=chunk, episode_index=place.index), 0.0


def _pictures(path: Path, start_s: float, fps: float, budget: Budget) -> Iterator[tuple[float, Any]]:
    """Yield time and picture from `start_s` on, at least one."""
    av = require_av()
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            budget.take(stream.width * stream.height * RGB_BYTES, path)
            if start_s > 0 and stream.time_base is not None:
                container.seek(int(start_s / stream.time_base), stream=stream)
            found = False
            for picture in container.decode(stream):
                if picture.time is not None and picture.time >= start_s - NEAR_S / fps:
                    found = True
                    yield picture.time, picture
    except (OSError, ValueError, IndexError) as error:  # av's own errors are among both
        raise DamagedError(path, f"cannot be decoded: {error}") from error
    if not found:
        raise DamagedError(path, f"ends before {start_s:.3f} s")


def _rgb(picture: Any) -> npt.NDArray[np.uint8]:  # noqa: ANN401
    return np.asarray(picture.to_ndarray(format="rgb24"), np.uint8)


def require_av() -> Any:  # noqa: ANN401
    """Return the module av; raises MissingPackageError."""
    try:
        import av
    except ImportError as error:
        raise MissingPackageError("videos of LeRobot datasets", "av") from error
    return av
