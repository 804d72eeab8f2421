"""To which servers images may be sent: who may configure a task must not thereby reach every address from here."""

from collections.abc import Mapping, Sequence
from typing import Any

import httpx

from app.pipeline.addresses import is_loopback
from app.pipeline.errors import InvalidInputError

SETTING = "ROBOPROMPT_POSE_SERVERS"


class PoseServers:
    """The servers that the estimator `remote` may ask.

    Args:
        prefixes: of their addresses, e.g. ``https://gpu-box:9000/``; none: this machine only.
    """

    def __init__(self, prefixes: Sequence[str] = ()) -> None:
        self._prefixes = tuple(map(httpx.URL, prefixes))

    def check(self, object_models: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse models whose server is none of them; models of other estimators pass.

        Raises:
            InvalidInputError: naming the object, the address and the setting that would allow it.
        """
        for name, model in object_models.items():
            if model["estimator"] == "remote" and not self._allow(httpx.URL(model["url"])):
                allowed = ", ".join(map(str, self._prefixes)) or "this machine only"
                message = f"is {model['url']!r}, where this service may not send images"
                raise InvalidInputError(f"object_models[{name}].url", message, f"{allowed} (set by {SETTING})")

    def _allow(self, url: httpx.URL) -> bool:
        if not self._prefixes:
            return is_loopback(url.host)
        return any(_below(url, prefix) for prefix in self._prefixes)


def _below(url: httpx.URL, prefix: httpx.URL) -> bool:
    """Whether `url` is `prefix` or continues its path, on the same server."""
    if (url.scheme, url.host, _port(url)) != (prefix.scheme, prefix.host, _port(prefix)):
        return False
    folder = prefix.path.rstrip("/") + "/"
    return ".." not in url.path and (url.path == prefix.path or url.path.startswith(folder))


def _port(url: httpx.URL) -> int | None:
    return url.port or {"http": 80, "https": 443}.get(url.scheme)
