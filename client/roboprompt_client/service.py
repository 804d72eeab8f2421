"""The connection to a service, and any document that it offers."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import httpx

from roboprompt_client.camera import RgbdFrame, camera_json
from roboprompt_client.connection import Connection, open_http
from roboprompt_client.encoding import ImageFormat, request_parts
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

OfKind = TypeVar("OfKind", bound="Service")
KEY_VARIABLE = "ROBOPROMPT_API_KEY"
DEFAULT_URL = os.environ.get("ROBOPROMPT_URL") or "http://127.0.0.1:8000"
LEARNING_TIMEOUT_S = 600.0


class Service:
    """A service that answers. Use it as a context manager, or call `close`.

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
        key = os.environ.get(KEY_VARIABLE, "") if api_key is None else api_key
        self._http = Connection(connection or open_http(url, key))
        self._images = ImageFormat.chosen(compress)

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

    def ping(self) -> None:
        """Ask whether the service is there.

        Raises:
            ServiceUnreachableError: if it does not answer, or what answers is no RoboPrompt service.
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
        return self._http.document("GET", path, params=parameters)

    def post(self, path: str, document: Mapping[str, Any], frames: Sequence[RgbdFrame] = ()) -> dict[str, Any]:
        """Send any document; with frames their cameras and images go along."""
        if not frames:
            return self._http.document("POST", path, json=dict(document), timeout=LEARNING_TIMEOUT_S)
        metadata = {**document, "cameras": [camera_json(frame.camera) for frame in frames]}
        return self._http.document("POST", path, files=request_parts(metadata, frames, self._images))

    def get_bytes(self, path: str, **parameters: Any) -> bytes:  # noqa: ANN401
        """Any file that the service offers, e.g. ``get_bytes(f"/episodes/{id}/trajectory")``."""
        return self._http.request("GET", path, params=parameters).content
