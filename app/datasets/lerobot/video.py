"""Reads first pictures and films from the videos of a LeRobot dataset, and writes films as videos, by PyAV.

A dataset has a picture for each row of its data, a film a few a second: a video repeats the last picture until the next
one was taken. A camera is a column of every episode or of none.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.bounds import Budget, DamagedError, MissingPackageError
from app.datasets.lerobot.files import Info, Place, path_of, read_file
from app.datasets.parcel import FILM_PREFIX, rgb_png
from app.untrusted_arrays import film_from_npz
from roboprompt_client.encoding import film_jpeg
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import FILM_HZ, MAX_PICTURES, Film

KEY = "observation.images."
# FFmpeg detects containers by content, and some refer to other files or addresses: those are not allowed.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # tolerance for the time of a picture, in frame durations
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
FILES_IN_CHUNK = 1000
CODEC, CODEC_NAME, PIXEL_FORMAT = "libx264", "h264", "yuv420p"
ENCODING = {"crf": "23", "preset": "veryfast", "g": "10"}  # every tenth picture can be read without the others
SAMPLED_PICTURES, SAMPLED_PX = 10, 16  # of an episode, for statistics: each 16th row and column
Shape = tuple[int, int, int]
Samples = npt.NDArray[np.uint8]


def first_picture(info: Info, place: Place, feature: str, budget: Budget) -> bytes:
    """Return an episode's first picture as a PNG; raises DamagedError, or MissingPackageError without av."""
    _, picture = next(_pictures(*_location(info, place, feature), info.fps, budget))
    return rgb_png(_rgb(picture))


def film_from_video(info: Info, place: Place, feature: str, camera: str, times_s: Array, budget: Budget) -> Film:
    """Return an episode's video as a film.

    Args:
        times_s: (T,) of the episode's rows.

    Raises:
        DamagedError, MissingPackageError: as `first_picture`.
        InvalidInputError: if it is larger than a film may be.
    """
    path, start_s = _location(info, place, feature)
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


def _location(info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """Return the video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(info.root / "meta/info.json", f"names no video_path for {feature}")
    if info.version == "v3.0":
        try:
            numbers = {f"{name}_index": int(place.row[f"videos/{feature}/{name}_index"]) for name in ("chunk", "file")}
            start_s = float(place.row[f"videos/{feature}/from_timestamp"])
        except (KeyError, TypeError, ValueError) as error:
            raise DamagedError(info.root / "meta/episodes", f"does not say where {feature} is: {error!r}") from error
        return path_of(info.root, info.video_path, video_key=feature, **numbers), start_s
    numbers = {"episode_chunk": place.index // info.chunks_size, "episode_index": place.index}
    return path_of(info.root, info.video_path, video_key=feature, **numbers), 0.0


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


class VideoWriter:
    """Writes the videos of the cameras that filmed every episode, in pictures of one size.

    Args:
        root: of the dataset, in which the scenes of the episodes are already.
        shapes: of each episode, the shapes of its films' pictures by camera.
        say: is called with the reason where films are left out.
    """

    def __init__(
        self, root: Path, fps: int, shapes: Sequence[Mapping[str, Shape]], say: Callable[[str], object]
    ) -> None:
        self._root, self._fps = root, fps
        cameras = sorted({camera for item in shapes for camera in item})
        common = [camera for camera in cameras if len({item.get(camera) for item in shapes}) == 1]
        if left := [camera for camera in cameras if camera not in common]:
            say(f"no video of {', '.join(left)}: not every episode has a film of that camera, of one size")
        try:
            self._shapes = {camera: shapes[0][camera] for camera in common}
            self._av: Any = require_av() if common else None
        except MissingPackageError as error:
            say(f"no video of {', '.join(common)}: {error}")
            self._shapes = {}

    @property
    def path(self) -> str | None:
        """The template of the videos' paths; None if there are none."""
        return VIDEO_PATH if self._shapes else None

    @property
    def features(self) -> dict[str, Any]:
        return {f"{KEY}{camera}": _feature(shape, self._fps) for camera, shape in self._shapes.items()}

    def row(self, index: int, length: int) -> dict[str, Any]:
        """Return where an episode's videos are, for meta/episodes."""
        chunk, file = divmod(index, FILES_IN_CHUNK)
        place = {"chunk_index": chunk, "file_index": file, "from_timestamp": 0.0, "to_timestamp": length / self._fps}
        return {f"videos/{KEY}{camera}/{name}": value for camera in self._shapes for name, value in place.items()}

    def write(self, index: int, times_s: Array) -> dict[str, Samples]:
        """Write an episode's videos; return samples (N, 3) of their colors by column.

        Args:
            times_s: (T,) of the episode's rows.

        Raises:
            DamagedError: if the first picture of a film cannot be decoded; a later one that cannot is left out.
        """
        chunk, file = divmod(index, FILES_IN_CHUNK)
        colors = {}
        for camera, shape in self._shapes.items():
            path = self._root / VIDEO_PATH.format(video_key=f"{KEY}{camera}", chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            film = film_from_npz(camera, read_file(self._root, index, f"{FILM_PREFIX}{camera}"))
            colors[f"{KEY}{camera}"] = self._write(path, film, shape, times_s)
        return colors

    def _write(self, path: Path, film: Film, shape: Shape, times_s: Array) -> Samples:
        shown = np.maximum(np.searchsorted(film.times_s, times_s, side="right") - 1, 0)
        samples, last, rgb = [], -1, None
        with self._av.open(str(path), "w") as container:
            stream = container.add_stream(CODEC, rate=self._fps, options=ENCODING)
            stream.height, stream.width, stream.pix_fmt = *shape[:2], PIXEL_FORMAT
            for row, number in enumerate(shown.tolist()):
                if number != last and (decoded := _decoded(film.pictures[number])) is not None:
                    rgb = np.ascontiguousarray(decoded[: shape[0], : shape[1]])
                if rgb is None:
                    raise DamagedError(path.name, f"the film of camera {film.camera} does not begin with a picture")
                last = number
                if row % max(1, len(shown) // SAMPLED_PICTURES) == 0:
                    samples.append(rgb[::SAMPLED_PX, ::SAMPLED_PX].reshape(-1, 3))
                picture = self._av.VideoFrame.from_ndarray(rgb, format="rgb24")
                picture.pts = row
                container.mux(stream.encode(picture))
            container.mux(stream.encode())
        return np.concatenate(samples)


def _feature(shape: Shape, fps: int) -> dict[str, Any]:
    about = {"height": shape[0], "width": shape[1], "channels": 3, "codec": CODEC_NAME, "pix_fmt": PIXEL_FORMAT}
    info = {f"video.{name}": value for name, value in {**about, "fps": fps, "is_depth_map": False}.items()}
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": list(shape), "names": names, "info": {**info, "has_audio": False}}


def video_shape(film: Film) -> Shape:
    """Return the shape of a film's video: even sides, as the codec needs; 0, 0, 3 without a first picture."""
    decoded = _decoded(film.pictures[0])
    return (0, 0, 3) if decoded is None else (decoded.shape[0] // 2 * 2, decoded.shape[1] // 2 * 2, 3)


def _decoded(data: bytes) -> npt.NDArray[np.uint8] | None:
    """Return a picture (H, W, 3), red first, or None."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return None if image is None else np.asarray(image[..., ::-1], np.uint8)
