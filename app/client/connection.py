"""The HTTP connection to a service: documents and files of any address, and every failure as an error of the client."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from json import JSONDecodeError
from types import TracebackType
from typing import Any, Self

import httpx
from httpx_sse import SSEError

from app.client.answers import problem_of
from app.client.errors import ServiceProblemError, ServiceUnreachableError
from app.pipeline.addresses import without_proxy

DEFAULT_URL = "http://127.0.0.1:8000"
MAX_PORT = 65535
KEPT_S = 2.0  # idle connections: the service closes them after 5 s, and a request that crosses this is lost


class Connection:
    """Use it as a context manager, or call `close`.

    Args:
        http: a client of httpx whose base address is the service's, see `connected`.
    """

    def __init__(self, http: httpx.Client) -> None:
        self._http = http

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where the service listens."""
        return str(self._http.base_url)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def ping(self) -> None:
        """Ask whether the service is there.

        Raises:
            ServiceUnreachableError: if nobody answers, or somebody else does.
            ServiceProblemError: if it refuses.
        """
        try:
            known = self.get("/healthz").get("checks") is not None
        except ServiceProblemError as error:
            if "type" in error.problem:
                raise
            known = False
        if not known:
            raise ServiceUnreachableError(f"{self.url}: what answers there is no RoboPrompt service")

    def get(self, path: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401
        """Any document that the service offers, e.g. ``get("/episodes", task="open_drawer")``."""
        return self._send("GET", path, params=parameters)

    def get_bytes(self, path: str, **parameters: Any) -> bytes:  # noqa: ANN401
        """Any file that the service offers, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return self._request("GET", path, params=parameters).content

    def _send(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:  # noqa: ANN401
        try:
            document = self._request(method, path, **arguments).json()
        except ValueError:
            document = None
        if not isinstance(document, dict):
            what = f"{method} {self._address(path)}: what answers there is no RoboPrompt service"
            raise ServiceUnreachableError(what)
        return document

    def _request(self, method: str, path: str, **arguments: Any) -> httpx.Response:  # noqa: ANN401
        with self._transport_errors(method, path):
            response = self._http.request(method, path, **arguments)
        if response.is_error:
            raise ServiceProblemError(response.status_code, problem_of(response))
        return response

    @contextmanager
    def _transport_errors(self, method: str, path: str) -> Iterator[None]:
        try:
            yield
        except (httpx.TransportError, SSEError, JSONDecodeError) as error:
            what = f"{method} {self._address(path)}: {error or type(error).__name__}"
            raise ServiceUnreachableError(what, timed_out=isinstance(error, httpx.TimeoutException)) from error

    def _address(self, path: str) -> str:
        return f"{self.url.rstrip('/')}/{path.lstrip('/')}"


def connected(url: str, headers: Mapping[str, str]) -> httpx.Client:
    """A connection to an address with a scheme and a host."""
    refusal = f"{url!r} is no address of a service (valid: one like {DEFAULT_URL})"
    try:
        parsed = httpx.URL(url)
        if parsed.scheme not in ("http", "https") or not parsed.host or (parsed.port or 0) > MAX_PORT:
            raise ServiceUnreachableError(refusal)
        limits = httpx.Limits(keepalive_expiry=KEPT_S)
        return httpx.Client(base_url=parsed, timeout=60, headers=headers, mounts=without_proxy(url), limits=limits)
    except (httpx.InvalidURL, ValueError) as error:
        raise ServiceUnreachableError(refusal) from error
