"""HTTP requests to one service: a JSON answer, its events, or one of this package's errors."""

import ipaddress
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import httpx
from httpx_sse import EventSource

from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

MAX_PORT = 65535
EVENT_STREAM = "text/event-stream"
DEFAULT_TIMEOUT_S = 60.0
KEEPALIVE_S = 2.0  # idle connections: the service closes them after 5 s, and a request that crosses this is lost
MAX_DETAIL_CHARS = 500  # of an error page that is no problem document


def is_loopback(host: str) -> bool:
    """Whether a host, by name or address, is this machine, which no other machine can reach."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_own_machine(url: str) -> bool:
    """Whether a URL names this machine: no proxy is for that, nor may one see what is sent there."""
    try:
        return is_loopback(urlsplit(url).hostname or "")
    except ValueError:
        return False


def without_proxy(url: str) -> dict[str, None] | None:
    """What httpx's `mounts` say so that proxies of the environment are not used for this machine; None for others.

    Certificates that the environment names are used all the same, which `trust_env=False` would not do.
    """
    return {"http://": None, "https://": None} if is_own_machine(url) else None


def open_http(url: str, api_key: str) -> httpx.Client:
    """An HTTP client for a service.

    Args:
        api_key: empty for none.

    Raises:
        ServiceUnreachableError: for a URL without scheme or host.
    """
    headers = {"Authorization": f"Bearer {api_key}"} if api_key else {}
    refusal = f"{url!r} is no address of a service (valid: one like http://127.0.0.1:8000)"
    try:
        parsed = httpx.URL(url)
        if parsed.scheme not in ("http", "https") or not parsed.host or (parsed.port or 0) > MAX_PORT:
            raise ServiceUnreachableError(refusal)
        limits = httpx.Limits(keepalive_expiry=KEEPALIVE_S)
        mounts = without_proxy(url)
        return httpx.Client(base_url=parsed, timeout=DEFAULT_TIMEOUT_S, headers=headers, mounts=mounts, limits=limits)
    except (httpx.InvalidURL, ValueError) as error:
        raise ServiceUnreachableError(refusal) from error


class Connection:
    """Sends requests; arguments beside method and path are those of `httpx.Client.request`.

    Every method raises ServiceProblemError if the service refuses or fails, and ServiceUnreachableError if it does not
    answer, or what answers is no RoboPrompt service.
    """

    def __init__(self, client: httpx.Client) -> None:
        self.client = client

    def request(self, method: str, path: str, **arguments: Any) -> httpx.Response:  # noqa: ANN401
        """The response, whatever its body is."""
        with self._transport_errors(method, path):
            response = self.client.request(method, path, **arguments)
        if response.is_error:
            raise ServiceProblemError(response.status_code, _problem(response))
        return response

    def document(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:  # noqa: ANN401
        """The JSON object that is answered."""
        document = _json(self.request(method, path, **arguments).content)
        if not isinstance(document, dict):
            what = f"{method} {self._address(path)}: what answers there is no RoboPrompt service"
            raise ServiceUnreachableError(what)
        return document

    def events(self, method: str, path: str, **arguments: Any) -> Iterator[tuple[str, dict[str, Any]]]:  # noqa: ANN401
        """The name and the JSON object of each server-sent event, as soon as it is complete."""
        headers = {**arguments.pop("headers", {}), "Accept": EVENT_STREAM}
        with (
            self._transport_errors(method, path),
            self.client.stream(method, path, headers=headers, **arguments) as response,
        ):
            if response.is_error:
                response.read()
                raise ServiceProblemError(response.status_code, _problem(response))
            for event in EventSource(response).iter_sse():
                if not event.data:  # then it is none (HTML standard, 9.2.6)
                    continue
                if not isinstance(document := _json(event.data), dict):
                    what = f"the data of the event {event.event!r:.40} are no JSON object: {event.data!r:.80}"
                    raise ServiceUnreachableError(f"{method} {self._address(path)}: {what}")
                yield event.event, document

    @contextmanager
    def _transport_errors(self, method: str, path: str) -> Iterator[None]:
        try:
            yield
        except httpx.TransportError as error:  # httpx-sse's SSEError, too
            what = f"{method} {self._address(path)}: {error or type(error).__name__}"
            raise ServiceUnreachableError(what, timed_out=isinstance(error, httpx.TimeoutException)) from error

    def _address(self, path: str) -> str:
        return f"{str(self.client.base_url).rstrip('/')}/{path.lstrip('/')}"


def _problem(response: httpx.Response) -> Mapping[str, Any]:
    """The problem document of an error; made of its text where it has none."""
    document = _json(response.content)
    if isinstance(document, dict):
        return document
    return {"title": response.reason_phrase, "detail": response.text[:MAX_DETAIL_CHARS]}


def _json(data: str | bytes) -> object:
    """None where it is no JSON."""
    try:
        return json.loads(data)
    except ValueError:
        return None
