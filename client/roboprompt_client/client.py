"""Clients of the service: `RoboPromptClient` blocks until the answer is there, `AsyncRoboPromptClient` is for asyncio.

The methods of both are the requests of `requests.py`, which documents their arguments.
"""

import os
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import httpx
from httpx_sse import EventSource

from roboprompt_client.answers import OnFindings, PredictedActions, StreamReader
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.http import Request, http_options, require_success
from roboprompt_client.requests import Requests
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction

P = ParamSpec("P")
Answer = TypeVar("Answer")
OfKind = TypeVar("OfKind", bound="RoboPromptClient")
Ask = Callable[Concatenate[Requests, P], Request[Answer]]
REQUESTS = Requests()
KEY_VARIABLE = "ROBOPROMPT_API_KEY"
DEFAULT_URL = os.environ.get("ROBOPROMPT_URL") or "http://127.0.0.1:8000"
CUT_OFF = "POST /predict: the stream ended before it was complete"


def _sent(ask: Ask[P, Answer]) -> Callable[Concatenate["RoboPromptClient", P], Answer]:
    """Return a client's method that sends the request, waits, and returns what the request reads from the answer."""

    @wraps(ask)
    def send(self: "RoboPromptClient", /, *arguments: P.args, **named: P.kwargs) -> Answer:
        request, http = ask(REQUESTS, *arguments, **named), self._http
        with request.transport_errors(http.base_url):
            response = http.request(request.method, request.path, **request.arguments)
        return request.read(response)

    return send


def _awaited(ask: Ask[P, Answer]) -> Callable[Concatenate["AsyncRoboPromptClient", P], Coroutine[Any, Any, Answer]]:
    """Return the same method as a coroutine; cancelling its task closes the connection, so that the service stops."""

    @wraps(ask)
    async def send(self: "AsyncRoboPromptClient", /, *arguments: P.args, **named: P.kwargs) -> Answer:
        request, http = ask(REQUESTS, *arguments, **named), self._http
        with request.transport_errors(http.base_url):
            response = await http.request(request.method, request.path, **request.arguments)
        return request.read(response)

    return send


class RoboPromptClient:
    """Upload demonstrations and ask for actions. Use it as a context manager, or call `close`.

    Args:
        url: where the service listens. Proxies of the environment are used unless the service runs on this machine.
        connection: an httpx client to use instead of a new one.
        api_key: for a service that requires one; None: the environment's ROBOPROMPT_API_KEY.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        connection: httpx.Client | None = None,
        *,
        api_key: str | None = None,
    ) -> None:
        self._http = connection or httpx.Client(**http_options(url, _key(api_key)))

    def __enter__(self: OfKind) -> OfKind:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where the service listens."""
        return str(self._http.base_url)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    ping = _sent(Requests.ping)
    get = _sent(Requests.get)
    post = _sent(Requests.post)
    get_bytes = _sent(Requests.get_bytes)
    plan = _sent(Requests.plan)
    predict = _sent(Requests.predict)
    find_poses = _sent(Requests.find_poses)
    record_outcome = _sent(Requests.record_outcome)
    report_run = _sent(Requests.report_run)
    end_run = _sent(Requests.end_run)
    configure_task = _sent(Requests.configure_task)
    motion_limits = _sent(Requests.motion_limits)
    upload = _sent(Requests.upload)
    upload_parts = _sent(Requests.upload_parts)
    edit_episode = _sent(Requests.edit_episode)
    check = _sent(Requests.check)
    learn_object_models = _sent(Requests.learn_object_models)
    label_object = _sent(Requests.label_object)
    learn_from_labels = _sent(Requests.learn_from_labels)

    def stream(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        *,
        on_findings: OnFindings | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Iterator[EndEffectorAction | PredictedActions]:
        """Yield each action as soon as the LLM has written it, then the whole answer.

        Args:
            on_findings: called before the first action, with the findings that the service has by then.
            options: as of `predict`.

        Raises:
            RoboPromptError: as `predict`; also after some actions, if the rest of the reply is missing.
            InvalidAnswerError: with `on_findings`, if the findings are not well formed.
        """
        reader = StreamReader(on_findings)
        request = REQUESTS.predict(task, instruction, observation, **options)
        with (
            request.transport_errors(self._http.base_url),
            self._http.stream(request.method, request.path, **request.streamed) as response,
        ):
            if response.is_error:
                response.read()
            for event in EventSource(require_success(response)).iter_sse():
                if (item := reader.read(event, response)) is not None:
                    yield item
                if isinstance(item, PredictedActions):
                    return
        raise ServiceUnreachableError(CUT_OFF)


class AsyncRoboPromptClient:
    """`RoboPromptClient` for asyncio: the same methods, to be awaited. Use it with `async with`, or await `close`.

    Args:
        url: as for `RoboPromptClient`.
        api_key: as for `RoboPromptClient`.
        connection: an httpx.AsyncClient to use instead of a new one.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        connection: httpx.AsyncClient | None = None,
        *,
        api_key: str | None = None,
    ) -> None:
        self._http = connection or httpx.AsyncClient(**http_options(url, _key(api_key)))

    async def __aenter__(self) -> "AsyncRoboPromptClient":
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    ping = _awaited(Requests.ping)
    get = _awaited(Requests.get)
    post = _awaited(Requests.post)
    get_bytes = _awaited(Requests.get_bytes)
    plan = _awaited(Requests.plan)
    predict = _awaited(Requests.predict)
    find_poses = _awaited(Requests.find_poses)
    record_outcome = _awaited(Requests.record_outcome)
    report_run = _awaited(Requests.report_run)
    end_run = _awaited(Requests.end_run)
    configure_task = _awaited(Requests.configure_task)
    motion_limits = _awaited(Requests.motion_limits)
    upload = _awaited(Requests.upload)
    upload_parts = _awaited(Requests.upload_parts)
    edit_episode = _awaited(Requests.edit_episode)
    check = _awaited(Requests.check)
    learn_object_models = _awaited(Requests.learn_object_models)
    label_object = _awaited(Requests.label_object)
    learn_from_labels = _awaited(Requests.learn_from_labels)

    async def stream(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        *,
        on_findings: OnFindings | None = None,
        **options: Any,  # noqa: ANN401
    ) -> AsyncIterator[EndEffectorAction | PredictedActions]:
        """Yield as `RoboPromptClient.stream` does; for `async for`."""
        reader = StreamReader(on_findings)
        request = REQUESTS.predict(task, instruction, observation, **options)
        with request.transport_errors(self._http.base_url):
            async with self._http.stream(request.method, request.path, **request.streamed) as response:
                if response.is_error:
                    await response.aread()
                async for event in EventSource(require_success(response)).aiter_sse():
                    if (item := reader.read(event, response)) is not None:
                        yield item
                    if isinstance(item, PredictedActions):
                        return
        raise ServiceUnreachableError(CUT_OFF)


def _key(api_key: str | None) -> str:
    return os.environ.get(KEY_VARIABLE, "") if api_key is None else api_key
