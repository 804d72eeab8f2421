"""Requests to an HTTP API whose replies are server-sent events: what all providers have in common.

A provider's module says how its requests and events are written.
Every error of httpx and every bad status is mapped to the tree of `base.py` here and nowhere else.
"""

import math
import re
from collections.abc import AsyncGenerator, Callable, Iterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from functools import cache
from ssl import SSLContext
from typing import Any

import httpx
from httpx_sse import EventSource, SSEError, aconnect_sse

from app.llm.base import (
    CompletionRequest,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    Pieces,
)
from app.llm.streaming import Chunk, assembled, error_message
from roboprompt_client.http import without_proxy

# Room for the tokens that a model thinks before it replies: they count against the limit of the reply's length.
# OpenAI's guide "Reasoning models" advises to reserve 25,000 at first; a pattern to continue takes far fewer.
THINKING_TOKENS = 8192
# What a 429 says when the account's money or quota is used up: asking again does not help.
# (OpenAI's error codes; Anthropic's rate_limit_error with details.error_code)
SPENT = re.compile(r"\b(insufficient_quota|credit_balance_exhausted|enforced_spend_limit_reached)\b")


# Reads the `data` of one event; None ends the reply. May raise ModelResponseError.
Parse = Callable[[str], Chunk | None]


@dataclass(frozen=True)
class Server:
    """The server of a provider's models.

    Attributes:
        base_url: up to and including the version, e.g. ``http://127.0.0.1:11434/v1``.
        key: which must not appear in any message; empty for a server that asks for none.
        key_variable, url_variable: what to set when the server refuses the key or cannot be reached, for messages.
    """

    base_url: str
    key: str = field(default="", repr=False)
    key_variable: str = ""
    url_variable: str = ""


class SseModel:
    """One model of one server.

    Args:
        path: of the endpoint, below the server's base URL.
        headers: of every request; they carry the key.
        write: a request's JSON body.
        parser: makes what reads the events of one reply.
        may_reason: as for `AnswerText`.
    """

    def __init__(
        self,
        profile: ModelProfile,
        server: Server,
        path: str,
        headers: Mapping[str, str],
        write: Callable[[CompletionRequest], dict[str, Any]],
        parser: Callable[[], Parse],
        *,
        may_reason: bool = False,
    ) -> None:
        self.profile = profile
        self._server = server
        self._url = f"{server.base_url.rstrip('/')}/{path}"
        self._headers = headers
        self._write = write
        self._parser = parser
        self._may_reason = may_reason
        self._where = f"{profile.name} ({_without_password(self._url)})"

    def stream(self, request: CompletionRequest) -> Pieces:
        return assembled(self._chunks(request), request.prompt.stop, self.profile.name, may_reason=self._may_reason)

    async def aclose(self) -> None:
        """Nothing is held."""

    async def _chunks(self, request: CompletionRequest) -> AsyncGenerator[Chunk, None]:
        """The events of the reply.

        Raises:
            ModelUnavailableError: no server, no such model, or a key that is refused.
            ModelBusyError: the server wants fewer requests.
            ModelResponseError: the server answered with an error, or its reply cannot be read.
        """
        parse = self._parser()
        with self._errors_mapped():
            async with self._asked(self._write(request)) as source:
                if source.response.status_code != httpx.codes.OK:
                    await source.response.aread()
                    raise self._refusal(source.response)
                async for event in source.aiter_sse():
                    chunk = parse(event.data)
                    if chunk is None:
                        return
                    yield chunk

    @asynccontextmanager
    async def _asked(self, body: Mapping[str, Any]) -> AsyncGenerator[EventSource, None]:
        """A connection of its own: llama.cpp hangs up on a kept one, so that the next request fails."""
        client = httpx.AsyncClient(
            headers={"Accept-Encoding": "identity", **self._headers},
            timeout=None,  # the deadline of the request covers everything
            verify=_certificates() if self._url.startswith("https:") else False,
            mounts=without_proxy(self._url),
        )
        async with client, AsyncExitStack() as stack:
            try:
                source = await stack.enter_async_context(aconnect_sse(client, "POST", self._url, json=body))
            except AttributeError as error:
                # httpcore asks a connection that broke as soon as it was made for its socket: uvloop has none then
                raise httpx.ConnectError("the connection broke as soon as it was made") from error
            yield source

    @contextmanager
    def _errors_mapped(self) -> Iterator[None]:
        """The errors of httpx as those of `base.py`, and no key in any text."""
        try:
            yield
        except (httpx.ConnectError, httpx.ProxyError, httpx.UnsupportedProtocol, httpx.InvalidURL) as error:
            remedy = f"; check {self._server.url_variable}" if self._server.url_variable else ""
            said = self._without_key(f"cannot reach {self._where}: {error}{remedy}")
            raise ModelUnavailableError(said, retryable=isinstance(error, httpx.ConnectError)) from error
        except (httpx.HTTPError, SSEError) as error:
            said = self._without_key(f"the reply of {self._where} cannot be read: {str(error) or type(error).__name__}")
            cut = isinstance(error, httpx.NetworkError | httpx.RemoteProtocolError)
            raise ModelResponseError(said, retryable=cut) from error
        except LanguageModelError as error:
            text = self._without_key(str(error))
            raise type(error)(text, retryable=error.retryable, retry_after_s=error.retry_after_s) from None

    def _refusal(self, response: httpx.Response) -> LanguageModelError:
        """Return the error that a status other than 200 stands for."""
        status, said = response.status_code, f"HTTP {response.status_code}: {error_message(response.text)}"
        if status in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
            remedy = f"; set {self._server.key_variable} to a valid key" if self._server.key_variable else ""
            return ModelUnavailableError(f"{self._where} refused the key: {said}{remedy}")
        if status == httpx.codes.NOT_FOUND:
            return ModelUnavailableError(f"there is no {self._where}: {said}")
        wait_s = _retry_after_s(response.headers)
        if status == httpx.codes.TOO_MANY_REQUESTS:
            if SPENT.search(response.text):
                return ModelUnavailableError(f"the account at {self._where} is used up: {said}")
            return ModelBusyError(f"{self._where} answered {said}", retryable=True, retry_after_s=wait_s)
        passing = status >= httpx.codes.INTERNAL_SERVER_ERROR or status == httpx.codes.REQUEST_TIMEOUT
        return ModelResponseError(f"{self._where} answered {said}", retryable=passing, retry_after_s=wait_s)

    def _without_key(self, text: str) -> str:
        key = self._server.key.strip()  # httpx shows a key with a stray line break as a literal
        return text.replace(key, "[key]") if key else text


@cache
def _certificates() -> SSLContext:
    """Read once: it takes 20 to 90 ms of the event loop."""
    return httpx.create_ssl_context()


def _retry_after_s(headers: httpx.Headers) -> float | None:
    """How long the server asks to wait; None where it says nothing, or a date."""
    try:
        wait_s = float(headers.get("Retry-After", ""))
    except ValueError:
        return None
    return max(wait_s, 0.0) if math.isfinite(wait_s) else None


def _without_password(url: str) -> str:
    scheme, _, rest = url.partition("://")
    authority, slash, path = rest.partition("/")
    return f"{scheme}://{authority.rpartition('@')[2]}{slash}{path}"
