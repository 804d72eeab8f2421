"""How much a request may ask for, as far as the operator sets it (docs/settings.md); the schemas have the rest."""

from dataclasses import dataclass
from fnmatch import fnmatchcase

from app.perception.images import MAX_PIXELS
from app.untrusted_arrays import MAX_UNPACKED_BYTES
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import MAX_FRAMES


@dataclass(frozen=True)
class Limits:
    """Bounds of requests.

    Attributes:
        max_request_pixels: of all its images together.
        max_unpacked_bytes: of a trajectory's .npz file.
        max_frames: of a trajectory.
        max_prompt_chars: system prompt and demonstrations together.
        allowed_models: patterns of models' names that requests may use besides the default; none: any.
        model_files: whether requests may name an embedded model by the path of its file.
    """

    max_image_pixels: int = MAX_PIXELS
    max_request_pixels: int = 4 * MAX_PIXELS
    max_unpacked_bytes: int = MAX_UNPACKED_BYTES
    max_frames: int = MAX_FRAMES
    max_prompt_chars: int = 400_000
    allowed_models: tuple[str, ...] = ()
    model_files: bool = True

    def check_pixels(self, num_pixels: int) -> None:
        if num_pixels > self.max_request_pixels:
            raise InvalidInputError("images", f"has {num_pixels} pixels together", f"at most {self.max_request_pixels}")

    def check_model(self, name: str) -> None:
        """Refuse models that the operator does not want to be used, and files of this machine."""
        if self.allowed_models and not any(fnmatchcase(name, pattern) for pattern in self.allowed_models):
            raise InvalidInputError("model", f"is {name!r}, which is not offered here", ", ".join(self.allowed_models))
        model = name.partition("embedded/")[2]
        if not self.model_files and ("/" in model or model.endswith(".gguf")):
            raise InvalidInputError("model", f"is {name!r}, a file of the service's machine", "a name from GET /models")

    def check_prompt(self, num_chars: int) -> None:
        if num_chars > self.max_prompt_chars:
            valid = f"at most {self.max_prompt_chars} characters: fewer or shorter demonstrations"
            raise InvalidInputError("num_demonstrations", f"makes a prompt of {num_chars} characters", valid)
