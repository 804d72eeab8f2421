"""An episode as the LLM reads it, in each representation."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.pipeline.episode import Demonstration
from app.pipeline.errors import InvalidInputError
from app.pipeline.prompt_colours import Span, prompt_spans
from app.pipeline.representation import KAT_FORMAT, REPRESENTATIONS, fit_codec
from app.services.task_settings import TaskSettings


@dataclass(frozen=True)
class EpisodeText:
    """A demonstration's part of a prompt.

    Attributes:
        usual: whether a request that names no representation gets this one.
        spans: coloured as in the paper; empty where there is an error.
        error: why it cannot be written so, in words.
    """

    representation: str
    prompt_format: str
    usual: bool
    spans: tuple[Span, ...]
    error: str = ""


def episode_texts(
    demonstrations: Sequence[Demonstration],
    shown: int,
    settings: TaskSettings,
    usual_representation: str,
    usual_format: str,
) -> tuple[EpisodeText, ...]:
    """One of the demonstrations of a prompt in each representation, the usual first.

    Args:
        demonstrations: as the prompt shows them.
        shown: which of the demonstrations, all of which the representations are fitted to.
    """
    texts = []
    for name in sorted(REPRESENTATIONS, key=lambda name: name != usual_representation):
        usual = name == usual_representation
        prompt_format = usual_format if usual or usual_format != KAT_FORMAT else "paper"
        try:
            codec = fit_codec(name, prompt_format, demonstrations, settings.workspace.workspace())
            text, error = codec.demonstration_text(demonstrations[shown]), ""
        except InvalidInputError as refused:
            text, error = "", str(refused)
        texts.append(EpisodeText(name, prompt_format, usual, prompt_spans(text, name, prompt_format), error))
    return tuple(texts)
