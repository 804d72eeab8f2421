"""Videos of a LeRobot dataset by PyAV: first pictures and films are read from them, and films are written as them.

A dataset has one picture for each row of its data, a film a few pictures a second: a written video repeats the last
picture until the next one was taken, and of a read one as many are kept as the client films.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import Budget, DamagedError, MissingPackageError
from app.datasets.lerobot.files import Info, Place, path_of
from app.datasets.parcel import rgb_png
from roboprompt_client.http.encoding import film_jpeg
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import FILM_HZ, Film

KEY = "observation.images."
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
FILES_IN_CHUNK = 1000
# FFmpeg detects containers by content, and some refer to other files or addresses: those are not allowed.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # tolerance for the time of a picture, in frame durations
CODEC, PIXEL_FORMAT = "libx264", "yuv420p"
ENCODING = {"crf": "23", "preset": "veryfast", "g": "10"}  # every tenth picture can be read without the others
SAMPLED_PICTURES, SAMPLED_PX = 10, 16  # of an episode, for statistics: each 16th row and column
Samples = npt.NDArray[np.uint8]


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
            due_s = times_s[row] + 1 / FILM_HZ - NEAR_S / info.fps
    return Film(camera, np.array([time_s for time_s, _ in kept]), tuple(data for _, data in kept))


def _location(root: Path, info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """Return the video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(root / "meta/info.json", f"names no video_path for {feature}")
    if info.version == "v3.0":
        numbers = {f"{name}_index": place.row[f"videos/{feature}/{name}_index"] for name in ("chunk", "file")}
        path = path_of(root, info.video_path, video_key=feature, **numbers)
        return path, float(place.row[f"videos/{feature}/from_timestamp"])
    chunk = place.index // info.chunks_size
    return path_of(root, info.video_path, video_key=feature, episode_chunk=chunk, episode_index=place.index), 0.0


def _pictures(path: Path, start_s: float, fps: float, budget: Budget) -> Iterator[tuple[float, Any]]:
    """Yield time and picture from `start_s` on, at least one."""
    av = require_av()
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
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


def write_video(root: Path, index: int, film: Film, times_s: Array, fps: int) -> Samples:
    """Write a film as the video of an episode, and return samples (N, 3) of its colors.

    Args:
        times_s: (T,) of the episode's rows.

    Raises:
        DamagedError: if the first picture cannot be decoded; a later one that cannot is left out.
        MissingPackageError: without av.
    """
    av, path, samples = require_av(), _path(root, film.camera, index), []
    path.parent.mkdir(parents=True, exist_ok=True)
    shown = np.maximum(np.searchsorted(film.times_s, times_s, side="right") - 1, 0)
    height_px, width_px, _ = picture_shape(film)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(CODEC, rate=fps, options=ENCODING)
        stream.width, stream.height, stream.pix_fmt = width_px, height_px, PIXEL_FORMAT
        last, rgb = -1, None
        for row, number in enumerate(shown.tolist()):
            if number != last and (decoded := _decoded(film.pictures[number])) is not None:
                rgb = np.ascontiguousarray(decoded[:height_px, :width_px])
            if rgb is None:
                raise DamagedError(path.name, f"the film of camera {film.camera} begins with what is no picture")
            last = number
            if row % max(1, len(shown) // SAMPLED_PICTURES) == 0:
                samples.append(rgb[::SAMPLED_PX, ::SAMPLED_PX].reshape(-1, 3))
            picture = av.VideoFrame.from_ndarray(rgb, format="rgb24")
            picture.pts = row
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return np.concatenate(samples)


def video_row(camera: str, index: int, length: int, fps: int) -> dict[str, Any]:
    """Return where the episode's video is, for meta/episodes."""
    chunk, file = divmod(index, FILES_IN_CHUNK)
    values = {"chunk_index": chunk, "file_index": file, "from_timestamp": 0.0, "to_timestamp": length / fps}
    return {f"videos/{KEY}{camera}/{name}": value for name, value in values.items()}


def video_feature(shape: tuple[int, ...], fps: int) -> Mapping[str, Any]:
    """Return a camera's entry in meta/info.json."""
    about = {"height": shape[0], "width": shape[1], "codec": "h264", "pix_fmt": PIXEL_FORMAT, "is_depth_map": False}
    described = {f"video.{name}": value for name, value in {**about, "fps": fps, "channels": 3}.items()}
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": list(shape), "names": names, "info": {**described, "has_audio": False}}


def picture_shape(film: Film) -> tuple[int, int, int]:
    """Return the shape of the film's video: even sides, as the codec needs."""
    decoded = _decoded(film.pictures[0])
    return (0, 0, 3) if decoded is None else (decoded.shape[0] // 2 * 2, decoded.shape[1] // 2 * 2, 3)


def _path(root: Path, camera: str, index: int) -> Path:
    chunk, file = divmod(index, FILES_IN_CHUNK)
    return root / VIDEO_PATH.format(video_key=f"{KEY}{camera}", chunk_index=chunk, file_index=file)


def _decoded(data: bytes) -> npt.NDArray[np.uint8] | None:
    """Return a picture (H, W, 3), red first, or None."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return None if image is None else np.asarray(image[..., ::-1], np.uint8)
