"""Actions <-> rows of text: one representation a file, chosen by name."""

from collections.abc import Callable, Sequence

from app.pipeline.episode import Demonstration
from app.pipeline.errors import InvalidInputError
from app.pipeline.representation.absolute import AbsoluteCodec
from app.pipeline.representation.base import Codec
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.workspace import Workspace

PROMPT_FORMATS = ("paper", "authors")
_FIT: dict[str, Callable[[Sequence[Demonstration], Workspace, bool], Codec]] = {
    "absolute": AbsoluteCodec.fit,
    "object_frame": ObjectFrameCodec.fit,
}
REPRESENTATIONS = tuple(_FIT)


def fit_codec(
    representation: str, prompt_format: str, demonstrations: Sequence[Demonstration], workspace: Workspace
) -> Codec:
    """The named representation, fitted to the demonstrations of one prompt.

    Args:
        prompt_format: `paper` puts the instruction into the observation, `authors` leaves it out.

    Raises:
        InvalidInputError: for an unknown name, or without demonstrations.
    """
    if representation not in _FIT:
        raise InvalidInputError("representation", f"is {representation!r}", ", ".join(REPRESENTATIONS))
    if prompt_format not in PROMPT_FORMATS:
        raise InvalidInputError("prompt_format", f"is {prompt_format!r}", ", ".join(PROMPT_FORMATS))
    if not demonstrations:
        raise InvalidInputError("demonstrations", "there are none", "at least one uploaded episode")
    return _FIT[representation](demonstrations, workspace, prompt_format == "paper")
