"""Gemma 3 270M with a smaller vocabulary: the same replies in less time.

For each token that it writes llama.cpp reads the whole output matrix: 178 of the file's 246 MB, a row for each of
262,144 tokens in all the world's scripts. A row that is left out changes no other token's score.
"""

import mmap
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from app.llm.base import CompletionRequest, Pieces, StartedModel
from app.llm.llama import gguf
from app.pipeline.prompt import Prompt

NUM_BYTES_AND_CONTROLS = 500  # the first tokens: begin, end, unknown, single bytes, tags
NUM_FREQUENT = 60_000  # tokens are numbered by how often they were merged; 32,000 cut common words into pieces
SINGLE_CHARACTERS = range(236_743, 255_999)
LATIN_END = 0x250  # code points below it are Latin letters, with and without accents
WORD_BOUNDARY = "\u2581"  # how the vocabulary writes a space
BY_TOKEN = ("tokenizer.ggml.tokens", "tokenizer.ggml.scores", "tokenizer.ggml.token_type")
MATRIX = "token_embd.weight"  # of the input and of the output
NOTICE = (
    "Modified by RoboPrompt from gemma-3-270m-q4_k_m.gguf: tokens that are neither ASCII nor Latin letters, and rare"
    " ones, were left out of the vocabulary and of the embedding matrix. Gemma is provided under and subject to the"
    " Gemma Terms of Use found at ai.google.dev/gemma/terms"
)


def kept_tokens(texts: Sequence[str]) -> list[int]:
    """The numbers of the tokens that stay, of Gemma's vocabulary `texts`."""
    return [number for number, text in enumerate(texts) if _stays(number, text.replace(WORD_BOUNDARY, " "))]


def _stays(number: int, text: str) -> bool:
    if number < NUM_BYTES_AND_CONTROLS:
        return True
    if number in SINGLE_CHARACTERS and len(text) == 1 and ord(text) < LATIN_END:
        return True
    return text.isascii() and (number < NUM_FREQUENT or not any(character.isalpha() for character in text))


def trim(whole: Path, trimmed: Path) -> None:
    """Write the file without the tokens that do not stay; the same bytes whenever and wherever it is made.

    Raises:
        OSError, ValueError: if a file cannot be read or written, or `whole` is not Gemma 3 270M as packaged.
    """
    with whole.open("rb") as source, closing(mmap.mmap(source.fileno(), 0, access=mmap.ACCESS_READ)) as mapped:
        parts = gguf.read(mapped)
        kept = kept_tokens(parts.array("tokenizer.ggml.tokens").texts())
        shorter = {name: parts.array(name).take(kept) for name in BY_TOKEN}
        values = {**parts.values, **shorter, "general.description": gguf.string_value(NOTICE)}
        tensors = {**parts.tensors, MATRIX: parts.tensors[MATRIX].take_rows(kept)}
        with trimmed.open("wb") as target:
            gguf.write(gguf.GgufFile(values, tensors), target)


def covers(prompt: Prompt) -> bool:
    """Whether the trimmed vocabulary has every character of the prompt; others would be read byte by byte."""
    text = prompt.system + prompt.user
    return text.isascii() or ord(max(text)) < LATIN_END


class TrimmedModel:
    """A model with a trimmed vocabulary; the first prompt that needs the whole one starts that beside it."""

    def __init__(self, trimmed: StartedModel, whole: StartedModel) -> None:
        self._trimmed = trimmed
        self.profile = trimmed.profile
        self._whole = whole

    def stream(self, request: CompletionRequest) -> Pieces:
        return self._for(request).stream(request)

    async def warm_up(self) -> None:
        await self._trimmed.warm_up()

    async def aclose(self) -> None:
        await self._trimmed.aclose()
        await self._whole.aclose()

    def _for(self, request: CompletionRequest) -> StartedModel:
        return self._trimmed if covers(request.prompt) else self._whole
