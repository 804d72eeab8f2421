"""Representations, actions <-> rows of text (paper, section III-C): one a file, chosen by name."""

from collections.abc import Sequence

from app.pipeline.representation.absolute import AbsoluteCodec
from app.pipeline.representation.action_tokens import ActionTokensCodec
from app.pipeline.representation.base import SUMS_FORMAT, Codec, check_style
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.parts import PartsCodec
from app.pipeline.representation.sums import SumsCodec
from app.pipeline.skill.shown import Shown
from app.pipeline.workspace import Workspace
from roboprompt_client.errors import InvalidInputError


def fit_codec(
    representation: str,
    prompt_format: str,
    shown: Sequence[Shown],
    workspace: Workspace,
) -> Codec:
    """The named representation of the demonstrations of one prompt.

    Args:
        prompt_format: `paper` puts the instruction into the observation, `authors` leaves it out, `sums`
            writes the numbers of absolute rows as sums.

    Raises:
        InvalidInputError: for an unknown name, a format that the representation does not have, without
            demonstrations, or for `parts` that the demonstrations do not have in common.
    """
    check_style(representation, prompt_format)
    if not shown:
        raise InvalidInputError("demonstrations", "there are none", "at least one uploaded episode")
    with_instruction = prompt_format == "paper"
    if representation == "object_frame":
        return ObjectFrameCodec.of(shown, workspace, with_instruction)
    if prompt_format == SUMS_FORMAT:
        return SumsCodec.of(shown, workspace)
    demonstrations = tuple(item.demonstration for item in shown)
    if representation == "parts":
        return PartsCodec.fit(demonstrations, with_instruction)
    codec = AbsoluteCodec if representation == "absolute" else ActionTokensCodec
    return codec(workspace, demonstrations, with_instruction)
