"""What a camera took during a motion: JPEG files with their times, and the `.npz` file in which they are uploaded."""

import io
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, settle
from roboprompt_client.types.names import checked_name
from roboprompt_client.types.trajectory import MAX_S

FILM_HZ = 5.0
MAX_PICTURES = 3000  # 10 minutes at 5 Hz
MAX_PICTURE_BYTES, MAX_FILM_BYTES = 1_000_000, 64_000_000
MAX_PICTURE_PIXELS = 1920 * 1200
ARRAYS = ("timestamps", "sizes", "jpegs")
VALID_FILM = "a .npz file of timestamps (N,) s, sizes (N,) bytes, jpegs (their sum,) uint8: the JPEG files in a row"


@dataclass(frozen=True, eq=False)
class Film:
    """The pictures of one camera, which needs no calibration.

    Attributes:
        times_s: (N,) increasing, by the clock of the trajectory's timestamps, or from its first frame if it has none.
        pictures: N JPEG files.
    """

    camera: str
    times_s: Array
    pictures: tuple[bytes, ...]

    def __post_init__(self) -> None:
        checked_name("film", self.camera)
        sizes, total = [len(picture) for picture in self.pictures], sum(map(len, self.pictures))
        if not 0 < len(sizes) <= MAX_PICTURES:
            raise InvalidInputError(self.field, f"has {len(sizes)} pictures", f"1 to {MAX_PICTURES}")
        times_s = bounded_array(f"{self.field}.timestamps", self.times_s, (len(sizes),), MAX_S, "s")
        if (late := np.flatnonzero(np.diff(times_s) <= 0)).size:
            message = f"element [{late[0] + 1}] is {times_s[late[0] + 1]:g}, after {times_s[late[0]]:g}"
            raise InvalidInputError(f"{self.field}.timestamps", message, "increasing seconds")
        if (most := max(sizes)) > MAX_PICTURE_BYTES:
            message = f"element [{sizes.index(most)}] is {most}"
            raise InvalidInputError(f"{self.field}.sizes", message, f"at most {MAX_PICTURE_BYTES} bytes")
        if total > MAX_FILM_BYTES:
            raise InvalidInputError(self.field, f"has {total} bytes of pictures", f"at most {MAX_FILM_BYTES}")
        settle(self, times_s=times_s)

    @property
    def field(self) -> str:
        """The name of its part in an upload."""
        return f"film_{self.camera}"

    def thinned(self, every: int) -> "Film":
        """Return the film with one of `every` pictures, the first among them."""
        return self if every == 1 else Film(self.camera, self.times_s[::every], self.pictures[::every])

    def part(self, start_s: float, end_s: float) -> "Film":
        """Return the pictures of that time; if there are none, the last one before it, as if taken at its start."""
        chosen = np.flatnonzero((self.times_s >= start_s) & (self.times_s <= end_s))
        if not chosen.size:
            chosen = np.array([max(0, int(np.searchsorted(self.times_s, start_s)) - 1)])
        times_s = np.clip(self.times_s[chosen], start_s, end_s)
        return Film(self.camera, times_s, tuple(self.pictures[k] for k in chosen))


def npz_from_film(film: Film) -> bytes:
    """Return the .npz file of a film; the same film gives the same bytes."""
    stream = io.BytesIO()
    sizes: npt.NDArray[np.int64] = np.array([len(picture) for picture in film.pictures], np.int64)
    jpegs = np.frombuffer(b"".join(film.pictures), np.uint8)
    np.savez(stream, timestamps=film.times_s, sizes=sizes, jpegs=jpegs)
    return stream.getvalue()
