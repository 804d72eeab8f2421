"""Requests to LLMs and their replies as files: written while models are asked, read back instead of asking them.

One JSON file for each question, named by a hash of what determines the reply: the model, the prompt and the sampling;
and one for each model. A question that is asked again keeps its latest reply. No file holds a key.
"""

import asyncio
import hashlib
import json
import os
import tempfile
from contextlib import aclosing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModel,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    Pieces,
    TextDelta,
)
from app.llm.llm_settings import variable


@dataclass(frozen=True)
class Recording:
    """A question and its reply."""

    question: dict[str, Any]  # what determines the reply
    pieces: list[str]  # the reply's text as it came
    completion: Completion | None  # how the reply ended; None if whoever asked broke it off


_RECORDING = TypeAdapter(Recording)
_PROFILE = TypeAdapter(ModelProfile)


def question_of(model: str, request: CompletionRequest) -> dict[str, Any]:
    """What determines the reply of a model."""
    prompt = request.prompt
    return {
        "model": model,
        "system": prompt.system,
        "user": prompt.user,
        "stop": list(prompt.stop),
        "grammar": prompt.grammar,
        "max_tokens": request.max_tokens,
        "temperature": request.temperature,
        "seed": request.seed,
    }


def hash_of(question: dict[str, Any]) -> str:
    """The name of a question's file."""
    return hashlib.sha256(json.dumps(question, sort_keys=True).encode()).hexdigest()[:32]


def _profile_path(folder: Path, model: str) -> Path:
    return folder / f"model-{hash_of({'model': model})}.json"


class RecordingModel:
    """A model whose replies are written to a folder. A reply that fails is not."""

    def __init__(self, model: LanguageModel, folder: Path) -> None:
        self._model = model
        self.profile = model.profile
        self._folder = folder

    async def aclose(self) -> None:
        await self._model.aclose()

    async def stream(self, request: CompletionRequest) -> Pieces:
        texts: list[str] = []
        completion: Completion | None = None
        try:
            async with aclosing(self._model.stream(request)) as pieces:
                async for piece in pieces:
                    if isinstance(piece, Completion):
                        completion = piece
                        await self._keep(request, texts or [completion.text], completion)
                    elif isinstance(piece, TextDelta):
                        texts.append(piece.text)
                    yield piece
        except GeneratorExit:
            if completion is None and texts:
                await self._keep(request, texts, None)
            raise

    async def _keep(self, request: CompletionRequest, texts: list[str], completion: Completion | None) -> None:
        question = question_of(self.profile.name, request)
        recording = Recording(question, texts, completion)
        await asyncio.to_thread(self._write, self._folder / f"{hash_of(question)}.json", recording)

    def _write(self, path: Path, recording: Recording) -> None:
        try:
            self._folder.mkdir(0o700, parents=True, exist_ok=True)
            if recording.completion is None and path.exists():
                return  # worth less than what is there
            _replace(_profile_path(self._folder, self.profile.name), _PROFILE.dump_json(self.profile, indent=1))
            _replace(path, _RECORDING.dump_json(recording, indent=1))
        except OSError as error:
            raise ModelUnavailableError(
                f"the reply cannot be recorded in {self._folder} ({error}); check {variable('record_llm')}"
            ) from error


def _replace(path: Path, content: bytes) -> None:
    """Write the file whole or not at all."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
        new = Path(folder) / path.name
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)


class ReplayedModel:
    """Answers from recordings, in the pieces that came; raises ModelUnavailableError if there is none of the model."""

    def __init__(self, name: str, folder: Path) -> None:
        self._folder = folder
        self.profile = _read(_profile_path(folder, name), _PROFILE, f"nothing is recorded of {name}")

    async def stream(self, request: CompletionRequest) -> Pieces:
        name = self.profile.name
        question_hash = hash_of(question_of(name, request))
        path = self._folder / f"{question_hash}.json"
        missing = f"no reply of {name} to question {question_hash} is recorded"
        recording = await asyncio.to_thread(_read, path, _RECORDING, missing)
        for text in recording.pieces:
            yield TextDelta(text)
        if recording.completion is None:
            raise ModelResponseError(f"the reply in {path} was broken off here when it was recorded")
        yield recording.completion

    async def aclose(self) -> None:
        """Nothing is held."""


T = TypeVar("T")


def _read(path: Path, kind: TypeAdapter[T], missing: str) -> T:
    """What a file of a recording holds; raises ModelUnavailableError if it is not there, or damaged."""
    try:
        return kind.validate_json(path.read_bytes())
    except FileNotFoundError:
        remedy = f"record it with {variable('record_llm')}"
        raise ModelUnavailableError(f"{missing} in {path.parent}; {remedy}") from None
    except (OSError, ValidationError) as error:
        raise ModelUnavailableError(f"the recording {path} cannot be read: {error}") from error
