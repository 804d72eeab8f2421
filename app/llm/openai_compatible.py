"""Any server that speaks OpenAI's HTTP API: OpenAI, vLLM, SGLang, Ollama, llama.cpp, OpenRouter.

A CompletionRequest becomes the body of a request, and each event of the streamed reply a Chunk. The format is that of
https://platform.openai.com/docs/api-reference (chat/completions and completions); where servers differ, `SERVERS` and
`HOSTS` say how.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from urllib.parse import urlsplit

from pydantic import BaseModel, Field, ValidationError

from app.llm.base import CompletionRequest, ModelProfile, ModelResponseError, Reading, Usage
from app.llm.llm_settings import CompatibleServer, Style
from app.llm.sse import THINKING_TOKENS, Server, SseModel
from app.llm.streaming import Chunk, error_message

END = "[DONE]"


@dataclass(frozen=True)
class ServerQuirks:
    """How a server's format differs from the common one.

    Attributes:
        max_tokens_field: what the limit of the reply's length is called.
        cache_key_field: what routes requests with the same prefix to the same cache, if the server knows such a field.
        grammar_path: the field, within fields, that takes a GBNF grammar.
        schema: the chat endpoint holds replies to a JSON Schema in `response_format`, also to one of a bare list.
        extra: further fields of every request.
        reasons_apart: a reply never contains reasoning. Of other servers' chat models none of the reply is certain
            before its end, and no stop string is sent: it would end the reasoning.
    """

    max_tokens_field: str = "max_tokens"
    cache_key_field: str | None = None
    grammar_path: tuple[str, ...] = ()
    schema: bool = False
    extra: tuple[tuple[str, Any], ...] = ()
    reasons_apart: bool = False


# `cache_prompt` keeps the prompt. llama.cpp notices that the client has gone when it sends something, with
# `return_progress` also while it reads the prompt. (llama.cpp, tools/server/README.md)
LLAMA_CPP = ServerQuirks(grammar_path=("grammar",), extra=(("cache_prompt", True), ("return_progress", True)))
# The service's own: a prompt's grammar holds from the first token on, which leaves no room for reasoning.
OWN_LLAMA_CPP = replace(LLAMA_CPP, reasons_apart=True)
# "Structured Outputs" of vLLM's documentation, since 0.12; its default backend xgrammar reads GBNF.
VLLM = ServerQuirks(grammar_path=("structured_outputs", "grammar"))
# "Structured Outputs" of SGLang's documentation: xgrammar, "currently uses the GGML BNF format".
SGLANG = ServerQuirks(grammar_path=("ebnf",))
# Ollama and LM Studio take no grammar ("OpenAI compatibility" and "Structured output" of their documentations). OpenAI
# wants an object at the top of a schema, which no demonstration shows: its models are left to continue the pattern.
JSON_SCHEMA = ServerQuirks(schema=True)
SERVERS: Mapping[CompatibleServer, ServerQuirks] = {
    "other": ServerQuirks(),
    "llama_cpp": LLAMA_CPP,
    "vllm": VLLM,
    "sglang": SGLANG,
    "ollama": JSON_SCHEMA,
    "lm_studio": JSON_SCHEMA,
}
# by the host of the base URL
HOSTS: Mapping[str, ServerQuirks] = {
    "api.openai.com": ServerQuirks("max_completion_tokens", cache_key_field="prompt_cache_key", reasons_apart=True)
}
# Models that reason before they reply refuse these fields (OpenAI's guide "Reasoning models").
REASONING_MODELS = re.compile(r"o[134](-|$)|gpt-([5-9]|\d\d)")
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


class _Progress(BaseModel):
    processed: int
    total: int


class _Event(BaseModel):
    choices: list[_Choice] = Field(default_factory=list)
    usage: _Usage | None = None
    prompt_progress: _Progress | None = None
    error: Any = None


def quirks_of(base_url: str) -> ServerQuirks:
    """The quirks of the server at `base_url`."""
    return HOSTS.get(urlsplit(base_url).hostname or "", ServerQuirks())


def request_body(request: CompletionRequest, model: str, style: Style, quirks: ServerQuirks) -> dict[str, Any]:
    """The JSON body that asks for `request` as a stream with usage; `model` is the server's name of it."""
    prompt, thinks = request.prompt, REASONING_MODELS.match(model)
    body: dict[str, Any] = {
        "model": model,
        quirks.max_tokens_field: request.max_tokens + (THINKING_TOKENS if thinks else 0),
        "temperature": request.temperature,
        "seed": request.seed,
        "stream": True,
        "stream_options": {"include_usage": True},
        **dict(quirks.extra),
    }
    if style == "chat":
        system = [{"role": "system", "content": prompt.system}] if prompt.system else []
        body["messages"] = [*system, {"role": "user", "content": prompt.user}]
    else:
        body["prompt"] = f"{prompt.system}\n{prompt.user}" if prompt.system else prompt.user
    if prompt.stop and not _may_reason(style, quirks):
        body["stop"] = list(prompt.stop)
    if quirks.cache_key_field and request.cache_key:
        body[quirks.cache_key_field] = request.cache_key
    if quirks.grammar_path and prompt.grammar:
        body |= _nested(quirks.grammar_path, prompt.grammar)
    if quirks.schema and prompt.schema and style == "chat":
        schema = {"name": "actions", "schema": dict(prompt.schema)}
        body["response_format"] = {"type": "json_schema", "json_schema": schema}
    return {name: value for name, value in body.items() if not (thinks and name in REFUSED_BY_REASONING_MODELS)}


def _may_reason(style: Style, quirks: ServerQuirks) -> bool:
    return style == "chat" and not quirks.reasons_apart


def _nested(path: tuple[str, ...], value: str) -> dict[str, Any]:
    """`value` at a path of fields."""
    return {path[0]: _nested(path[1:], value) if path[1:] else value}


def parse_event(data: str) -> Chunk | None:
    """Return one event as a Chunk; None at the end. Raises ModelResponseError, also for another format."""
    if data == END:
        return None
    try:
        event = _Event.model_validate_json(data)
    except ValidationError:
        raise ModelResponseError(f"the reply is not in OpenAI's format: {data[:200]!r}") from None
    if event.error:
        raise ModelResponseError(f"the reply broke off: {error_message(data)}")
    usage = _usage(event.usage) if event.usage else None
    if event.prompt_progress:
        return Chunk(usage=usage, reading=Reading(event.prompt_progress.processed, event.prompt_progress.total))
    if not event.choices:
        return Chunk(usage=usage)
    choice = event.choices[0]
    text = choice.text or (choice.delta.content if choice.delta else None) or ""
    return Chunk(text, choice.finish_reason, usage)


def _usage(usage: _Usage) -> Usage:
    cached = usage.prompt_tokens_details.cached_tokens if usage.prompt_tokens_details else None
    return Usage(usage.prompt_tokens, cached or 0, usage.completion_tokens)


class OpenAiCompatibleModel(SseModel):
    """One model of a server, by the server's name of it; without `quirks`, it has those of the server's host."""

    def __init__(self, profile: ModelProfile, server: Server, model: str, quirks: ServerQuirks | None = None) -> None:
        quirks = quirks_of(server.base_url) if quirks is None else quirks
        path = "chat/completions" if profile.style == "chat" else "completions"
        headers = {"Authorization": f"Bearer {server.key}"} if server.key else {}
        write = partial(request_body, model=model, style=profile.style, quirks=quirks)
        may_reason = _may_reason(profile.style, quirks)
        super().__init__(profile, server, path, headers, write, lambda: parse_event, may_reason=may_reason)
