"""The service as a robot sees it: one client that waits, and one for asyncio."""

import os
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import httpx

from roboprompt_client.answers import PredictedActions
from roboprompt_client.connection import AsyncConnection, Connection, Request, http_options
from roboprompt_client.encoding import ImageFormat
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.requests import CUT_OFF, OnFindings, StreamReader
from roboprompt_client.robot import Observation
from roboprompt_client.teaching import TeachingRequests
from roboprompt_client.trajectory import EndEffectorAction

P = ParamSpec("P")
Answer = TypeVar("Answer")
OfKind = TypeVar("OfKind", bound="RoboPromptClient")
OfAsyncKind = TypeVar("OfAsyncKind", bound="AsyncRoboPromptClient")
Asked = TeachingRequests
Ask = Callable[Concatenate[TeachingRequests, P], Request[Answer]]
KEY_VARIABLE = "ROBOPROMPT_API_KEY"
DEFAULT_URL = os.environ.get("ROBOPROMPT_URL") or "http://127.0.0.1:8000"


def _sent(ask: Ask[P, Answer]) -> Callable[Concatenate["RoboPromptClient", P], Answer]:
    """The method that sends a request and waits for what is answered."""

    @wraps(ask)
    def send(self: "RoboPromptClient", /, *arguments: P.args, **named: P.kwargs) -> Answer:
        return self._http.send(ask(self._requests, *arguments, **named))

    return send


def _awaited(ask: Ask[P, Answer]) -> Callable[Concatenate["AsyncRoboPromptClient", P], Coroutine[Any, Any, Answer]]:
    """The same as a coroutine."""

    @wraps(ask)
    async def send(self: "AsyncRoboPromptClient", /, *arguments: P.args, **named: P.kwargs) -> Answer:
        return await self._http.send(ask(self._requests, *arguments, **named))

    return send


class RoboPromptClient:
    """Uploads demonstrations and asks for actions. Use it as a context manager, or call `close`.

    Args:
        url: where the service listens; proxies of the environment are used unless that is this machine.
        connection: an httpx client to use instead of an own one.
        api_key: where the service requires one; None: the environment's ROBOPROMPT_API_KEY.
        compress: send images as JPEG and PNG, for a slow network (needs the extra `images`); otherwise as they are,
            which saves both sides the time to encode and decode them. None: compressed where the extra is installed.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        connection: httpx.Client | None = None,
        *,
        api_key: str | None = None,
        compress: bool | None = None,
    ) -> None:
        self._http = Connection(connection or httpx.Client(**http_options(url, _key(api_key))))
        self._requests = TeachingRequests(ImageFormat.chosen(compress))

    def __enter__(self: OfKind) -> OfKind:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where the service listens."""
        return str(self._http.client.base_url)

    def close(self) -> None:
        """Close the connections."""
        self._http.client.close()

    ping = _sent(Asked.ping)
    get = _sent(Asked.get)
    post = _sent(Asked.post)
    get_bytes = _sent(Asked.get_bytes)
    plan = _sent(Asked.plan)
    predict = _sent(Asked.predict)
    dry_run = _sent(Asked.dry_run)
    find_poses = _sent(Asked.find_poses)
    record_outcome = _sent(Asked.record_outcome)
    report_run = _sent(Asked.report_run)
    end_run = _sent(Asked.end_run)
    configure_task = _sent(Asked.configure_task)
    motion_limits = _sent(Asked.motion_limits)
    upload = _sent(Asked.upload)
    upload_parts = _sent(Asked.upload_parts)
    edit_episode = _sent(Asked.edit_episode)
    check = _sent(Asked.check)
    learn_object_models = _sent(Asked.learn_object_models)
    label_object = _sent(Asked.label_object)
    learn_from_labels = _sent(Asked.learn_from_labels)

    def stream(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        *,
        on_findings: OnFindings | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Iterator[EndEffectorAction | PredictedActions]:
        """Each action as soon as the LLM has written it, then the whole answer.

        Args:
            on_findings: called with what the service doubts beforehand, ahead of the first action.
            options: as of `predict`.

        Raises:
            RoboPromptError: as `predict`; also after actions were given, if the rest of the reply is missing.
            InvalidAnswerError: with `on_findings`, if the findings are not well formed.
        """
        reader = StreamReader(on_findings)
        request = self._requests.predict(task, instruction, observation, **options)
        for event in self._http.events(request):
            if (item := reader.read(*event)) is not None:
                yield item
            if isinstance(item, PredictedActions):
                return
        raise ServiceUnreachableError(CUT_OFF)


class AsyncRoboPromptClient:
    """`RoboPromptClient` for asyncio: the same methods, each to be awaited; `async with`, or await `close`.

    Args:
        url: as there; `api_key` and `compress`, too.
        connection: an httpx.AsyncClient to use instead of an own one.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        connection: httpx.AsyncClient | None = None,
        *,
        api_key: str | None = None,
        compress: bool | None = None,
    ) -> None:
        self._http = AsyncConnection(connection or httpx.AsyncClient(**http_options(url, _key(api_key))))
        self._requests = TeachingRequests(ImageFormat.chosen(compress))

    async def __aenter__(self: OfAsyncKind) -> OfAsyncKind:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.client.aclose()

    ping = _awaited(Asked.ping)
    get = _awaited(Asked.get)
    post = _awaited(Asked.post)
    get_bytes = _awaited(Asked.get_bytes)
    plan = _awaited(Asked.plan)
    predict = _awaited(Asked.predict)
    dry_run = _awaited(Asked.dry_run)
    find_poses = _awaited(Asked.find_poses)
    record_outcome = _awaited(Asked.record_outcome)
    report_run = _awaited(Asked.report_run)
    end_run = _awaited(Asked.end_run)
    configure_task = _awaited(Asked.configure_task)
    motion_limits = _awaited(Asked.motion_limits)
    upload = _awaited(Asked.upload)
    upload_parts = _awaited(Asked.upload_parts)
    edit_episode = _awaited(Asked.edit_episode)
    check = _awaited(Asked.check)
    learn_object_models = _awaited(Asked.learn_object_models)
    label_object = _awaited(Asked.label_object)
    learn_from_labels = _awaited(Asked.learn_from_labels)

    async def stream(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        *,
        on_findings: OnFindings | None = None,
        **options: Any,  # noqa: ANN401
    ) -> AsyncIterator[EndEffectorAction | PredictedActions]:
        """As `RoboPromptClient.stream`, with `async for`."""
        reader = StreamReader(on_findings)
        request = self._requests.predict(task, instruction, observation, **options)
        async for event in self._http.events(request):
            if (item := reader.read(*event)) is not None:
                yield item
            if isinstance(item, PredictedActions):
                return
        raise ServiceUnreachableError(CUT_OFF)


def _key(api_key: str | None) -> str:
    return os.environ.get(KEY_VARIABLE, "") if api_key is None else api_key
