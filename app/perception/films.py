"""Checks films of strangers by the headers of their JPEG files. The service decodes none: browsers do."""

from app.perception.images import JPEG_END, JPEG_SIGNATURE, MAX_SCANS, jpeg_size, num_scans
from app.untrusted_arrays import film_from_npz
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.film import MAX_PICTURE_PIXELS, Film


def checked_film(camera: str, data: bytes, times_s: Array) -> Film:
    """Return an uploaded film.

    Args:
        times_s: of the recording's frames, by the film's clock.

    Raises:
        InvalidInputError: naming the array, or the picture by its number from 0, and what is valid.
    """
    film = film_from_npz(camera, data)
    first_s, last_s = float(times_s[0]), float(times_s[-1])
    for number, time_s in enumerate(film.times_s.tolist()):
        if not first_s <= time_s <= last_s:
            message = f"element [{number}] is {time_s:g}, outside the recording"
            raise InvalidInputError(f"{film.field}.timestamps", message, f"{first_s:g} to {last_s:g} s")
    sizes_px = [_size_px(f"{film.field}.jpegs[{number}]", picture) for number, picture in enumerate(film.pictures)]
    for number, size_px in enumerate(sizes_px):
        if size_px != sizes_px[0]:
            message = "has {}x{} pixels, the first picture {}x{}".format(*size_px, *sizes_px[0])
            raise InvalidInputError(f"{film.field}.jpegs[{number}]", message, "one size for a film")
    return film


def _size_px(field: str, picture: bytes) -> tuple[int, int]:
    """Return width and height."""
    if not picture.startswith(JPEG_SIGNATURE) or JPEG_END not in picture[-64:]:
        message = f"begins with {picture[:3]!r} and ends with {picture[-2:]!r}"
        raise InvalidInputError(field, message, "a whole JPEG file; sizes say where each begins")
    width, height = jpeg_size(picture)
    if not 0 < width * height <= MAX_PICTURE_PIXELS:
        raise InvalidInputError(field, f"claims {width}x{height} pixels", f"1 to {MAX_PICTURE_PIXELS} pixels")
    if (scans := num_scans(picture)) > MAX_SCANS:
        raise InvalidInputError(field, f"has {scans} scans", f"at most {MAX_SCANS}")
    return width, height
