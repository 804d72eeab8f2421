"""Anthropic's Claude models through the Messages API: requests in its format, and its streamed replies as Chunks.

The format is that of https://platform.claude.com/docs/en/api/messages and .../build-with-claude/streaming; where models
differ, `MODELS` says how.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from pydantic import BaseModel, Field, ValidationError

from app.llm.base import CompletionRequest, ModelProfile, ModelResponseError, Usage
from app.llm.sse import THINKING_TOKENS, Server, SseModel
from app.llm.streaming import Chunk, error_message

# ("Versions" of the documentation) The newer one has no field `temperature` for any model.
VERSION = "2026-10-21"
VERSION_WITH_TEMPERATURE = "2023-06-01"
RETRYABLE = ("overloaded_error", "api_error", "rate_limit_error")  # errors within a stream that may pass


@dataclass(frozen=True)
class ModelQuirks:
    """The fields that a model accepts. A pattern to continue needs no thinking, and greedy decoding suits it best."""

    fields: Mapping[str, Any]  # of every request; they turn thinking off, or down where it cannot be turned off
    thinks: bool = False  # thinking stays on
    temperature: bool = False  # the model can be asked to decode greedily


_OFF = ModelQuirks({"thinking": {"type": "disabled"}})
_ALWAYS = ModelQuirks({"output_config": {"effort": "low"}}, thinks=True)
_OLDER = ModelQuirks({}, temperature=True)
# By how the model's name begins, the first that fits. From the models' pages and migration guides: thinking is on by
# default since Claude 5, and `temperature` refused since Opus 4.7.
MODELS: Mapping[str, ModelQuirks] = {
    "claude-opus-5-5": _ALWAYS,
    "claude-fable-": _ALWAYS,
    "claude-sonnet-5-5": ModelQuirks({"thinking": {"type": "between_tools"}}),
    "claude-haiku-5": _OFF,
    "claude-sonnet-5": _OFF,
    "claude-opus-5": _OFF,
    "claude-opus-4-7": ModelQuirks({}),
    "claude-opus-4-8": ModelQuirks({}),
    "claude-opus-4": _OLDER,
    "claude-sonnet-4": _OLDER,
    "claude-haiku-4": _OLDER,
    "claude-3": _OLDER,
}
UNKNOWN = ModelQuirks({}, thinks=True)  # no field that a model may refuse, and room in case it thinks
_FINISH_REASONS = {
    "end_turn": "stop",
    "stop_sequence": "stop",
    "max_tokens": "length",
    "model_context_window_exceeded": "length",
}


class _Usage(BaseModel):
    input_tokens: int | None = None
    cache_creation_input_tokens: int | None = None
    cache_read_input_tokens: int | None = None
    output_tokens: int | None = None


class _Delta(BaseModel):
    type: str = ""
    text: str = ""
    stop_reason: str | None = None


class _Message(BaseModel):
    usage: _Usage = Field(default_factory=_Usage)


class _Event(BaseModel):
    type: str
    message: _Message | None = None
    delta: _Delta | None = None
    usage: _Usage | None = None
    error: Any = None


def quirks_of(model: str) -> ModelQuirks:
    """The quirks of a model."""
    return next((quirks for start, quirks in MODELS.items() if model.startswith(start)), UNKNOWN)


def request_headers(model: str, api_key: str) -> dict[str, str]:
    """Return the headers of every request for the model."""
    version = VERSION_WITH_TEMPERATURE if quirks_of(model).temperature else VERSION
    return {"x-api-key": api_key, "anthropic-version": version}


def request_body(request: CompletionRequest, model: str) -> dict[str, Any]:
    """The JSON body that asks for `request` as a stream. The API has no seed."""
    prompt, quirks = request.prompt, quirks_of(model)
    body: dict[str, Any] = {
        "model": model,
        "max_tokens": request.max_tokens + (THINKING_TOKENS if quirks.thinks else 0),
        "stream": True,
        "messages": [{"role": "user", "content": _user_content(request)}],
        **quirks.fields,
    }
    if prompt.system:
        body["system"] = prompt.system
    if quirks.temperature:
        body["temperature"] = request.temperature
    # The API refuses a stop sequence without a visible character, and one might end the thinking; `streaming.assembled`
    # stops there all the same.
    if (stop := [text for text in prompt.stop if text.strip()]) and not quirks.thinks:
        body["stop_sequences"] = stop
    return body


def _user_content(request: CompletionRequest) -> list[dict[str, Any]]:
    """The user message in two parts; everything up to the end of the first, with the system prompt, is cached."""
    prefix = {"type": "text", "text": request.prompt.prefix, "cache_control": {"type": "ephemeral"}}
    query = {"type": "text", "text": request.prompt.query}
    return [prefix, query] if request.prompt.prefix else [query]  # the API refuses an empty text


class EventParser:
    """Reads the events of one reply; its usage comes in parts."""

    def __init__(self) -> None:
        self._usage = Usage()

    def __call__(self, data: str) -> Chunk | None:
        """Return one event as a Chunk; None at the end. Raises ModelResponseError, also for another format."""
        try:
            event = _Event.model_validate_json(data)
        except ValidationError:
            raise ModelResponseError(f"the reply is not in Anthropic's format: {data[:200]!r}") from None
        match event:
            case _Event(type="error"):
                passing = isinstance(event.error, dict) and event.error.get("type") in RETRYABLE
                raise ModelResponseError(f"the reply broke off: {error_message(data)}", retryable=passing)
            case _Event(type="message_start", message=_Message(usage=usage)):
                return Chunk(usage=self._counted(usage))
            case _Event(type="content_block_delta", delta=_Delta(type="text_delta", text=text)):
                return Chunk(text)
            case _Event(type="message_delta", delta=_Delta(stop_reason=str(reason)), usage=usage):
                return Chunk("", _FINISH_REASONS.get(reason, reason), self._counted(usage or _Usage()))
            case _Event(type="message_stop"):
                return None
        return Chunk()  # pings, thinking, and what the API may add

    def _counted(self, usage: _Usage) -> Usage:
        """The usage so far; later counts are totals."""
        before = self._usage
        cached = before.cached_tokens if usage.cache_read_input_tokens is None else usage.cache_read_input_tokens
        prompt = before.prompt_tokens
        if usage.input_tokens is not None:  # counts neither what was read from the cache nor what was written to it
            prompt = usage.input_tokens + cached + (usage.cache_creation_input_tokens or 0)
        self._usage = Usage(prompt, cached, usage.output_tokens or before.completion_tokens)
        return self._usage


class AnthropicModel(SseModel):
    """One Claude model, by Anthropic's name of it."""

    def __init__(self, profile: ModelProfile, server: Server, model: str) -> None:
        headers = request_headers(model, server.key)
        super().__init__(profile, server, "messages", headers, partial(request_body, model=model), EventParser)
