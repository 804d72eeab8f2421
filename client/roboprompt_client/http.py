"""HTTP with one service: how it is reached, and answers read as JSON or raised as this package's errors."""

import ipaddress
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import httpx

from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError

KEY_VARIABLE = "ROBOPROMPT_API_KEY"
MAX_PORT = 65535
DEFAULT_TIMEOUT_S = 60.0
KEEPALIVE_S = 2.0  # idle connections; the service closes them after 5 s, and a request sent at that moment is lost
MAX_DETAIL_CHARS = 500  # of an error page that is not a problem document


def is_loopback(host: str) -> bool:
    """Return whether a host name or address is this machine's loopback, which no other machine can reach."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def without_proxy(url: str) -> dict[str, None] | None:
    """Return httpx's `mounts` that ignore the environment's proxies for this machine; None for other machines.

    Certificates of the environment are still used, unlike with `trust_env=False`.
    """
    try:
        own = is_loopback(urlsplit(url).hostname or "")
    except ValueError:
        own = False
    return {"http://": None, "https://": None} if own else None


def http_options(url: str, api_key: str | None) -> dict[str, Any]:
    """Return the arguments of an httpx client for a service.

    Args:
        api_key: None: the one in the environment; an empty one is none.

    Raises:
        ServiceUnreachableError: for a URL without scheme or host.
        InvalidInputError: for a key with blanks, or letters outside ASCII.
    """
    api_key = os.environ.get(KEY_VARIABLE, "") if api_key is None else api_key
    if not re.fullmatch(r"[!-~]*", api_key):
        raise InvalidInputError("api_key", "has blanks, or letters outside ASCII", "as `roboprompt keys add` prints it")
    headers = {"Authorization": f"Bearer {api_key}"} if api_key else {}
    refusal = f"{url!r} is not the address of a service (valid: one like http://127.0.0.1:8000)"
    try:
        parsed = httpx.URL(url)
        if parsed.scheme not in ("http", "https") or not parsed.host or (parsed.port or 0) > MAX_PORT:
            raise ServiceUnreachableError(refusal)
    except (httpx.InvalidURL, ValueError) as error:
        raise ServiceUnreachableError(refusal) from error
    limits, mounts = httpx.Limits(keepalive_expiry=KEEPALIVE_S), without_proxy(url)
    return {"base_url": parsed, "timeout": DEFAULT_TIMEOUT_S, "headers": headers, "mounts": mounts, "limits": limits}


@contextmanager
def transport_errors(method: str, address: str) -> Iterator[None]:
    """Raise ServiceUnreachableError, naming the request, if it is not answered."""
    try:
        yield
    except httpx.TransportError as error:
        what = f"{method} {address}: {error or type(error).__name__}"
        if isinstance(error, httpx.ConnectError):
            what += ": is the service running, and is this its address?"
        raise ServiceUnreachableError(what, timed_out=isinstance(error, httpx.TimeoutException)) from error


def require_success(response: httpx.Response) -> httpx.Response:
    """Return the response; raises ServiceProblemError if the service refused or failed."""
    if not response.is_error:
        return response
    problem = _json(response.content)
    if not isinstance(problem, dict):  # not a problem document
        problem = {"title": response.reason_phrase, "detail": response.text[:MAX_DETAIL_CHARS]}
    raise ServiceProblemError(response.status_code, problem)


def document_in(response: httpx.Response) -> dict[str, Any]:
    """Return the JSON object of a response.

    Raises:
        ServiceProblemError: if the service refused or failed.
        ServiceUnreachableError: if what answers is not a RoboPrompt service.
    """
    document = _json(require_success(response).content)
    if not isinstance(document, dict):
        asked = f"{response.request.method} {response.url.copy_with(query=None)}"
        raise ServiceUnreachableError(f"{asked}: what answers there is not a RoboPrompt service")
    return document


def _json(data: bytes) -> object:
    """Return the decoded JSON, or None if it is not JSON."""
    try:
        return json.loads(data)
    except ValueError:
        return None
