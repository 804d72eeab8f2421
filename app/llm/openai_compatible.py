"""Any server that speaks OpenAI's HTTP API: OpenAI, vLLM, Ollama, llama.cpp, OpenRouter.

Every error of httpx and every bad status is mapped to the tree of `base.py` here and nowhere else.
"""

from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from contextlib import aclosing, contextmanager
from typing import Literal

import httpx
from httpx_sse import SSEError, aconnect_sse

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModelError,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    TextDelta,
    Usage,
)
from app.llm.openai_wire import Chunk, Quirks, error_message, parse_event, quirks_of, request_body, request_path
from app.llm.streaming import Pieces, StopStrings, whole, within_deadline

MAX_REPLY_BYTES = 256 * 1024  # 25 actions take 1 kB; the rest is room for prose
MAX_WIRE_BYTES = 16 * MAX_REPLY_BYTES  # each token of a few characters comes wrapped in some 250 bytes of JSON


class OpenAiCompatibleModel:
    """One model of one server.

    Args:
        base_url: up to and including the version, e.g. ``http://127.0.0.1:11434/v1``.
        model: the server's name of the model.
        api_key: empty for a server that asks for none.
        key_variable, url_variable: what to set when the server refuses the key or cannot be reached, for messages.
        quirks: how the server differs; by its host if None.
        trust_env: whether proxies named in the environment are used.
    """

    def __init__(
        self,
        profile: ModelProfile,
        base_url: str,
        model: str,
        api_key: str = "",
        *,
        key_variable: str = "",
        url_variable: str = "",
        quirks: Quirks | None = None,
        trust_env: bool = True,
    ) -> None:
        self._profile = profile
        self._url = f"{base_url.rstrip('/')}/{request_path(profile.style)}"
        self._where = f"{profile.name} ({_without_password(self._url)})"
        self._model = model
        self._api_key = api_key
        self._key_variable = key_variable
        self._url_variable = url_variable
        self._quirks = quirks_of(base_url) if quirks is None else quirks
        self._trust_env = trust_env
        self._client: httpx.AsyncClient | None = None
        self._closed = False

    @property
    def profile(self) -> ModelProfile:
        return self._profile

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._pieces(request), request.timeout_s, self._profile.name)

    async def complete(self, request: CompletionRequest) -> Completion:
        return await whole(self.stream(request))

    async def aclose(self) -> None:
        self._closed = True
        if self._client:
            await self._client.aclose()

    async def _pieces(self, request: CompletionRequest) -> Pieces:
        """The reply's text as it comes, then the Completion."""
        text, finish_reason, usage, size = "", "", Usage(), 0
        # A model that refuses stop strings may go on: its reply ends there all the same.
        stops = StopStrings(request.prompt.stop)
        async with aclosing(self._chunks(request)) as chunks:
            async for chunk in chunks:
                finish_reason = chunk.finish_reason or finish_reason
                usage = chunk.usage or usage
                size += len(chunk.text)
                if size > MAX_REPLY_BYTES:
                    raise ModelResponseError(f"{self._where} replied with more than {MAX_REPLY_BYTES} characters")
                if piece := stops.feed(chunk.text):
                    text += piece
                    yield TextDelta(piece)
        if held := stops.flush():
            text += held
            yield TextDelta(held)
        yield Completion(text, usage, _finish_reason(finish_reason, stops.stopped))

    async def _chunks(self, request: CompletionRequest) -> AsyncGenerator[Chunk, None]:
        """The events of the streamed reply."""
        body = request_body(request, self._model, self._profile.style, self._quirks)
        with self._errors_mapped():
            async with aconnect_sse(self._http(), "POST", self._url, json=body) as source:
                if source.response.status_code != httpx.codes.OK:
                    await source.response.aread()
                    raise self._refusal(source.response)
                async for event in source.aiter_sse():
                    if event.data == "[DONE]":
                        return
                    yield parse_event(event.data)

    def _http(self) -> httpx.AsyncClient:
        if self._closed:
            raise ModelUnavailableError(f"{self._profile.name} is closed")
        if self._client is None:
            key = {"Authorization": f"Bearer {self._api_key}"} if self._api_key else {}
            self._client = httpx.AsyncClient(
                headers={"Accept-Encoding": "identity", **key},
                timeout=None,  # the deadline of the request covers everything
                limits=httpx.Limits(max_connections=None),
                event_hooks={"response": [_cap_size]},
                verify=self._url.startswith("https:"),  # reading the certificates takes 20 to 90 ms of the event loop
                trust_env=self._trust_env,
            )
        return self._client

    @contextmanager
    def _errors_mapped(self) -> Iterator[None]:
        """The errors of httpx as those of `base.py`, and no key in any text."""
        try:
            yield
        except (httpx.ConnectError, httpx.ProxyError, httpx.UnsupportedProtocol, httpx.InvalidURL) as error:
            remedy = f"; check {self._url_variable}" if self._url_variable else ""
            raise ModelUnavailableError(f"cannot reach {self._where}: {error}{remedy}") from error
        except (httpx.HTTPError, SSEError) as error:
            reason = str(error) or type(error).__name__
            raise ModelResponseError(f"the reply of {self._where} cannot be read: {reason}") from error
        except LanguageModelError as error:
            raise type(error)(self._without_key(str(error))) from None

    def _refusal(self, response: httpx.Response) -> LanguageModelError:
        """What a status other than 200 means."""
        said = f"HTTP {response.status_code}: {error_message(response.text)}"
        if response.status_code in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
            remedy = f"; set {self._key_variable} to a valid key" if self._key_variable else ""
            return ModelUnavailableError(f"{self._where} refused the key: {said}{remedy}")
        if response.status_code == httpx.codes.NOT_FOUND:
            return ModelUnavailableError(f"there is no {self._where}: {said}")
        return ModelResponseError(f"{self._where} answered {said}")

    def _without_key(self, text: str) -> str:
        return text.replace(self._api_key, "[key]") if self._api_key else text


class _CappedStream(httpx.AsyncByteStream):
    """A reply's bytes, no more than `MAX_WIRE_BYTES` of them."""

    def __init__(self, stream: httpx.AsyncByteStream, where: str) -> None:
        self._stream = stream
        self._where = where

    async def __aiter__(self) -> AsyncIterator[bytes]:
        size = 0
        async for piece in self._stream:
            size += len(piece)
            if size > MAX_WIRE_BYTES:
                raise ModelResponseError(f"{self._where} replied with more than {MAX_WIRE_BYTES} bytes")
            yield piece

    async def aclose(self) -> None:
        await self._stream.aclose()


async def _cap_size(response: httpx.Response) -> None:
    assert isinstance(response.stream, httpx.AsyncByteStream)
    response.stream = _CappedStream(response.stream, _without_password(str(response.url)))


def _without_password(url: str) -> str:
    scheme, _, rest = url.partition("://")
    authority, slash, path = rest.partition("/")
    return f"{scheme}://{authority.rpartition('@')[2]}{slash}{path}"


def _finish_reason(reason: str, stopped: bool) -> Literal["stop", "length"]:
    """Why the reply ended, as its server says it.

    Args:
        stopped: a stop string came.
    """
    if stopped or reason == "stop":
        return "stop"
    if reason == "length":
        return "length"
    if not reason:
        raise ModelResponseError("the reply ended before it was complete")
    raise ModelResponseError(f"the reply was ended for the reason {reason!r}")
