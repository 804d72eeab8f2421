"""`AsyncRoboPromptClient`: the methods of `RoboPromptClient` for asyncio."""

from collections.abc import AsyncIterator, Callable, Coroutine
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import httpx
from httpx_sse import EventSource

from roboprompt_client.answers import OnFindings, PredictedActions, StreamReader
from roboprompt_client.client import CUT_OFF, DEFAULT_URL, RoboPromptClient
from roboprompt_client.encoding import prediction_request
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.http import Request, http_options, require_success
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction

P = ParamSpec("P")
Answer = TypeVar("Answer")


class _Unsent(RoboPromptClient):
    """A client whose methods return their requests instead of sending them."""

    def __init__(self) -> None:
        pass

    def _send(self, request: Request[Any]) -> Any:  # noqa: ANN401
        return request


_UNSENT = _Unsent()


def _awaited(
    method: Callable[Concatenate[RoboPromptClient, P], Answer],
) -> Callable[Concatenate["AsyncRoboPromptClient", P], Coroutine[Any, Any, Answer]]:
    """Return the method as a coroutine; cancelling its task closes the connection, so that the service stops."""

    @wraps(method)
    async def send(self: "AsyncRoboPromptClient", /, *arguments: P.args, **named: P.kwargs) -> Answer:
        request: Request[Answer] = method(_UNSENT, *arguments, **named)  # type: ignore[assignment]  # see `_Unsent`
        with request.transport_errors(self._http.base_url):
            response = await self._http.request(request.method, request.path, **request.arguments)
        return request.read(response)

    return send


class AsyncRoboPromptClient:
    """`RoboPromptClient` for asyncio: the same methods, to be awaited. Use it with `async with`, or await `close`.

    Args:
        url: as for `RoboPromptClient`.
        api_key: as for `RoboPromptClient`.
        connection: an httpx.AsyncClient to use instead of a new one.
    """

    def __init__(
        self, url: str = DEFAULT_URL, connection: httpx.AsyncClient | None = None, *, api_key: str | None = None
    ) -> None:
        self._http = connection or httpx.AsyncClient(**http_options(url, api_key))

    async def __aenter__(self) -> "AsyncRoboPromptClient":
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    ping = _awaited(RoboPromptClient.ping)
    get = _awaited(RoboPromptClient.get)
    post = _awaited(RoboPromptClient.post)
    get_bytes = _awaited(RoboPromptClient.get_bytes)
    plan = _awaited(RoboPromptClient.plan)
    predict = _awaited(RoboPromptClient.predict)
    find_poses = _awaited(RoboPromptClient.find_poses)
    record_outcome = _awaited(RoboPromptClient.record_outcome)
    configure_task = _awaited(RoboPromptClient.configure_task)
    motion_limits = _awaited(RoboPromptClient.motion_limits)
    upload = _awaited(RoboPromptClient.upload)
    upload_parts = _awaited(RoboPromptClient.upload_parts)
    edit_episode = _awaited(RoboPromptClient.edit_episode)
    check = _awaited(RoboPromptClient.check)
    learn_object_models = _awaited(RoboPromptClient.learn_object_models)
    label_object = _awaited(RoboPromptClient.label_object)
    learn_from_labels = _awaited(RoboPromptClient.learn_from_labels)

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
        request = prediction_request(task, instruction, observation, **options)
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
