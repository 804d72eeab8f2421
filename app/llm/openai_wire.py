"""OpenAI's HTTP format: a CompletionRequest -> the body of a request; an event of the streamed reply -> a Chunk.

The format is that of https://platform.openai.com/docs/api-reference (chat/completions and completions); where servers
differ, `QUIRKS` says how.
"""

import json
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from pydantic import BaseModel, Field, ValidationError

from app.llm.base import CompletionRequest, ModelResponseError, Usage
from app.llm.settings import Style


@dataclass(frozen=True)
class Quirks:
    """How a server's format differs from the common one.

    Attributes:
        max_tokens_field: what the limit of the reply's length is called.
        cache_key_field: what routes requests with the same prefix to the same cache, if the server knows such a field.
        marked_parts: the server caches up to a marked part of the message (Anthropic's `cache_control`).
        llama_cpp: the server takes GBNF grammars and keeps prompts.
    """

    max_tokens_field: str = "max_tokens"
    cache_key_field: str | None = None
    marked_parts: bool = False
    llama_cpp: bool = False


LLAMA_CPP = Quirks(llama_cpp=True)
# by the host of the base URL
QUIRKS = {
    "api.openai.com": Quirks(max_tokens_field="max_completion_tokens", cache_key_field="prompt_cache_key"),
    "openrouter.ai": Quirks(marked_parts=True),
}
# Models that reason before they reply refuse these fields (OpenAI's guide "Reasoning models").
REASONING_MODELS = ("o1", "o3", "o4", "gpt-5")
REFUSED_BY_REASONING_MODELS = ("temperature", "stop", "seed")


class _Details(BaseModel):
    cached_tokens: int | None = None


class _Usage(BaseModel):
    prompt_tokens: int = 0
    completion_tokens: int = 0
    prompt_tokens_details: _Details | None = None


class _Delta(BaseModel):
    content: str | None = None


class _Choice(BaseModel):
    text: str | None = None
    delta: _Delta | None = None
    finish_reason: str | None = None


class _Event(BaseModel):
    choices: list[_Choice] = Field(default_factory=list)
    usage: _Usage | None = None
    error: Any = None


@dataclass(frozen=True)
class Chunk:
    """What one event of a streamed reply tells; any of it may be missing."""

    text: str = ""
    finish_reason: str | None = None
    usage: Usage | None = None


def quirks_of(base_url: str) -> Quirks:
    """The quirks of the server at `base_url`."""
    return QUIRKS.get(urlsplit(base_url).hostname or "", Quirks())


def request_path(style: Style) -> str:
    """The endpoint, relative to the base URL."""
    return "chat/completions" if style == "chat" else "completions"


def request_body(request: CompletionRequest, model: str, style: Style, quirks: Quirks) -> dict[str, Any]:
    """The JSON body that asks for `request` as a stream with usage.

    Args:
        model: the server's name of the model.
    """
    prompt = request.prompt
    body: dict[str, Any] = {
        "model": model,
        quirks.max_tokens_field: request.max_tokens,
        "temperature": request.temperature,
        "seed": request.seed,
        "stream": True,
        "stream_options": {"include_usage": True},
    }
    if style == "chat":
        system = [{"role": "system", "content": prompt.system}] if prompt.system else []
        body["messages"] = [*system, {"role": "user", "content": _user_content(request, quirks)}]
    else:
        body["prompt"] = f"{prompt.system}\n{prompt.user}" if prompt.system else prompt.user
    if prompt.stop:
        body["stop"] = list(prompt.stop)
    if quirks.cache_key_field and request.cache_key:
        body[quirks.cache_key_field] = request.cache_key
    if quirks.llama_cpp:
        body["cache_prompt"] = True
        # llama.cpp notices that the client has gone when it sends something, with this also while it reads the prompt
        body["return_progress"] = True
        if prompt.grammar:
            body["grammar"] = prompt.grammar
    if model.startswith(REASONING_MODELS):
        return {name: value for name, value in body.items() if name not in REFUSED_BY_REASONING_MODELS}
    return body


def _user_content(request: CompletionRequest, quirks: Quirks) -> str | list[dict[str, Any]]:
    """The user message; in two parts, the first marked, where the server caches up to a mark."""
    prompt = request.prompt
    if not (quirks.marked_parts and prompt.prefix):
        return prompt.user
    return [
        {"type": "text", "text": prompt.prefix, "cache_control": {"type": "ephemeral"}},
        {"type": "text", "text": prompt.query},
    ]


def parse_event(data: str) -> Chunk:
    """What the `data` of one event says.

    Raises:
        ModelResponseError: if it is an error, or not in OpenAI's format.
    """
    try:
        event = _Event.model_validate_json(data)
    except ValidationError:
        raise ModelResponseError(f"the reply is not in OpenAI's format: {data[:200]!r}") from None
    if event.error:
        raise ModelResponseError(f"the reply broke off: {error_message(data)}")
    usage = _usage(event.usage) if event.usage else None
    if not event.choices:
        return Chunk(usage=usage)
    choice = event.choices[0]
    text = choice.text or (choice.delta.content if choice.delta else None) or ""
    return Chunk(text, choice.finish_reason, usage)


def _usage(usage: _Usage) -> Usage:
    cached = usage.prompt_tokens_details.cached_tokens if usage.prompt_tokens_details else None
    return Usage(usage.prompt_tokens, cached or 0, usage.completion_tokens)


def error_message(body: str) -> str:
    """The message in an error's body (`{"error": {"message": ...}}` or `{"error": "..."}`), else its beginning."""
    try:
        error = json.loads(body)["error"]
        return str(error["message"] if isinstance(error, dict) else error)
    except (ValueError, LookupError, TypeError):
        return " ".join(body[:300].split()) or "no message"
