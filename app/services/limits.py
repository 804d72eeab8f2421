"""How much a request may ask for. Each bound can be set, see docs/settings.md."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from app.perception.images import MAX_PIXELS
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory_npz import MAX_FRAMES, MAX_UNPACKED_BYTES
from roboprompt_client.wording import MAX_INSTRUCTION_CHARS, MAX_NAME_CHARS


@dataclass(frozen=True)
class Limits:
    """Bounds of requests.

    Attributes:
        max_request_pixels: of all its images together.
        max_unpacked_bytes: of a trajectory's .npz file.
        max_frames: of a trajectory.
        max_prompt_chars: system prompt and demonstrations together.
        max_page_size: items of a list.
        allowed_models: patterns of models' names that requests may use besides the default; none: any.
        model_files: whether requests may name an embedded model by the path of its file.
    """

    max_image_pixels: int = MAX_PIXELS
    max_request_pixels: int = 4 * MAX_PIXELS
    max_unpacked_bytes: int = MAX_UNPACKED_BYTES
    max_frames: int = MAX_FRAMES
    max_objects: int = 64
    max_cameras: int = 16
    max_name_chars: int = MAX_NAME_CHARS
    max_instruction_chars: int = MAX_INSTRUCTION_CHARS
    max_prompt_chars: int = 400_000
    max_page_size: int = 200
    allowed_models: tuple[str, ...] = ()
    model_files: bool = True

    def check_scene(self, task: str | None, instruction: str, objects: Sequence[str], cameras: Sequence[str]) -> None:
        """Refuse a scene that is too large.

        Args:
            objects, cameras: their names.

        Raises:
            InvalidInputError: naming what is too long or too many.
        """
        self.check_names("task", [] if task is None else [task])
        _check("instruction", len(instruction), self.max_instruction_chars, "characters")
        self.check_views(objects, cameras)

    def check_views(self, objects: Sequence[str], cameras: Sequence[str]) -> None:
        """As `check_scene`, where neither task nor instruction is given."""
        _check("objects", len(objects), self.max_objects, "objects")
        _check("cameras", len(cameras), self.max_cameras, "cameras")
        self.check_names("objects.name", objects)
        self.check_names("cameras.name", cameras)

    def check_names(self, field: str, names: Iterable[str]) -> None:
        """Refuse names that are too long."""
        for name in names:
            _check(field, len(name), self.max_name_chars, "characters")

    def check_pixels(self, num_pixels: int) -> None:
        """Refuse images that have too many pixels together."""
        _check("images", num_pixels, self.max_request_pixels, "pixels together")

    def check_page(self, limit: int) -> None:
        """Refuse a page that is too long."""
        _check("limit", limit, self.max_page_size, "items")

    def check_model(self, name: str) -> None:
        """Refuse models that the operator does not want to be used, and files of this machine."""
        if self.allowed_models and not any(fnmatchcase(name, pattern) for pattern in self.allowed_models):
            raise InvalidInputError("model", f"is {name!r}, which is not offered here", ", ".join(self.allowed_models))
        model = name.partition("embedded/")[2]
        if not self.model_files and ("/" in model or model.endswith(".gguf")):
            raise InvalidInputError("model", f"is {name!r}, a file of the service's machine", "a name from GET /models")

    def check_prompt(self, num_chars: int) -> None:
        """Refuse a prompt that is too long."""
        if num_chars > self.max_prompt_chars:
            valid = f"at most {self.max_prompt_chars} characters: fewer or shorter demonstrations"
            raise InvalidInputError("num_demonstrations", f"makes a prompt of {num_chars} characters", valid)


def _check(field: str, number: int, most: int, of_what: str) -> None:
    if number > most:
        raise InvalidInputError(field, f"has {number} {of_what}", f"at most {most}")
