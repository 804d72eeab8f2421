"""Actions <-> rows of text: one representation a file, chosen by name."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from app.pipeline.episode import Demonstration
from app.pipeline.representation.absolute import AbsoluteCodec
from app.pipeline.representation.action_tokens import ActionTokensCodec, KatCodec
from app.pipeline.representation.base import Codec
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.other_tasks import OtherTasksCodec
from app.pipeline.workspace import Workspace
from roboprompt_client.errors import InvalidInputError

PROMPT_FORMATS = ("paper", "authors")  # RoboPrompt's: every representation has them
KAT_FORMAT = "kat"  # KAT's own, of its action tokens only
_FIT: dict[str, Callable[[Sequence[Demonstration], Workspace, bool], Codec]] = {
    "absolute": AbsoluteCodec.fit,
    "object_frame": ObjectFrameCodec.fit,
    "action_tokens": ActionTokensCodec.fit,
}
REPRESENTATIONS = tuple(_FIT)


def fit_codec(
    representation: str, prompt_format: str, demonstrations: Sequence[Demonstration], workspace: Workspace
) -> Codec:
    """The named representation, fitted to the demonstrations of one prompt.

    Args:
        prompt_format: `paper` puts the instruction into the observation, `authors` leaves it out, `kat` is KAT's.

    Raises:
        InvalidInputError: for an unknown name, a format that the representation does not have, or without
            demonstrations.
    """
    check_style(representation, prompt_format)
    if not demonstrations:
        raise InvalidInputError("demonstrations", "there are none", "at least one uploaded episode")
    fit = KatCodec.fit if prompt_format == KAT_FORMAT else _FIT[representation]
    return fit(demonstrations, workspace, prompt_format == "paper")


def fit_other_tasks(
    representation: str, prompt_format: str, tasks: Sequence[Sequence[Demonstration]], workspace: Workspace
) -> Codec:
    """As `fit_codec`, for the demonstrations of several tasks, none of them the one that is asked for.

    Rows relative to objects are fitted task by task; of the others only the number of rows depends on demonstrations.
    """
    everything = [demonstration for shown in tasks for demonstration in shown]
    codec = fit_codec(representation, prompt_format, everything[:1], workspace)
    if isinstance(codec, ObjectFrameCodec):
        return OtherTasksCodec.fit(tasks, workspace, codec.with_instruction)
    return fit_codec(representation, prompt_format, everything, workspace)


def fit_step(
    representation: str, prompt_format: str, demonstrations: Sequence[Demonstration], workspace: Workspace, step: int
) -> Codec:
    """As `fit_codec`, for the demonstrations of one step (from 0) of a closed loop; rows go on counting over steps."""
    codec = fit_codec(representation, prompt_format, demonstrations, workspace)
    return replace(codec, first_row=step + 1) if isinstance(codec, ObjectFrameCodec) else codec


def check_style(representation: str, prompt_format: str) -> None:
    """Refuse what cannot be written.

    Raises:
        InvalidInputError: for an unknown name, or a format that the representation does not have.
    """
    if representation not in _FIT:
        raise InvalidInputError("representation", f"is {representation!r}", ", ".join(REPRESENTATIONS))
    formats = (*PROMPT_FORMATS, KAT_FORMAT) if representation == "action_tokens" else PROMPT_FORMATS
    if prompt_format not in formats:
        valid = ", ".join(formats)
        if prompt_format == KAT_FORMAT:
            valid += f"; {KAT_FORMAT} with the representation action_tokens"
        raise InvalidInputError(
            "prompt_format", f"is {prompt_format!r} with the representation {representation!r}", valid
        )
