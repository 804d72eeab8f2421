"""HTTP with the service: requests and observations as values, and answers read as JSON or raised as errors."""

import io
import ipaddress
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Generic, TypeVar
from urllib.parse import urlsplit

import httpx
import numpy as np
from httpx_sse import ServerSentEvent

from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import RgbdFrame, camera_json
from roboprompt_client.types.film import MAX_PICTURE_PIXELS
from roboprompt_client.types.poses import object_json

Answer = TypeVar("Answer")
Other = TypeVar("Other")
MAX_PORT = 65535
EVENT_STREAM = "text/event-stream"
DEFAULT_TIMEOUT_S = 60.0
KEEPALIVE_S = 2.0  # idle connections; the service closes them after 5 s, and a request sent at that moment is lost
MAX_DETAIL_CHARS = 500  # of an error page that is not a problem document
Part = tuple[str, bytes, str]
JPEG_QUALITY, FILM_QUALITY = 95, 85
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


def is_loopback(host: str) -> bool:
    """Return whether a host name or address is this machine's loopback, which no other machine can reach."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_own_machine(url: str) -> bool:
    """Return whether a URL names this machine; requests to it must not go through a proxy."""
    try:
        return is_loopback(urlsplit(url).hostname or "")
    except ValueError:
        return False


def without_proxy(url: str) -> dict[str, None] | None:
    """Return httpx's `mounts` that ignore the environment's proxies for this machine; None for other machines.

    Certificates of the environment are still used, unlike with `trust_env=False`.
    """
    return {"http://": None, "https://": None} if is_own_machine(url) else None


def http_options(url: str, api_key: str) -> dict[str, Any]:
    """Return the arguments of an httpx client for a service; an empty key means no key.

    Raises:
        ServiceUnreachableError: for a URL without scheme or host.
        InvalidInputError: for a key with blanks, or letters outside ASCII.
    """
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
    limits = httpx.Limits(keepalive_expiry=KEEPALIVE_S)
    proxies = without_proxy(url)
    return {"base_url": parsed, "timeout": DEFAULT_TIMEOUT_S, "headers": headers, "mounts": proxies, "limits": limits}


@dataclass(frozen=True)
class Request(Generic[Answer]):
    """A request to a service, and the function that reads its answer.

    Attributes:
        arguments: of `httpx.Client.request`.
        read: raises ServiceProblemError if the service refused or failed, and ServiceUnreachableError if what answers
            is not a RoboPrompt service.
    """

    method: str
    path: str
    arguments: Mapping[str, Any]
    read: Callable[[httpx.Response], Answer]

    def then(self, read: Callable[[Answer], Other]) -> "Request[Other]":
        """Return the same request whose answer is then read by `read`, too."""
        return Request(self.method, self.path, self.arguments, lambda response: read(self.read(response)))

    @property
    def streamed(self) -> dict[str, Any]:
        """The arguments with which the answer comes as server-sent events."""
        return {**self.arguments, "headers": {**self.arguments.get("headers", {}), "Accept": EVENT_STREAM}}

    @contextmanager
    def transport_errors(self, base_url: httpx.URL) -> Iterator[None]:
        """Raise ServiceUnreachableError, naming the request, if it is not answered."""
        try:
            yield
        except httpx.TransportError as error:  # also httpx-sse's SSEError
            address = f"{str(base_url).rstrip('/')}/{self.path.lstrip('/')}"
            what = f"{self.method} {address}: {error or type(error).__name__}"
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
    """Return the JSON object of a response; raises as `Request.read`."""
    document = _json(require_success(response).content)
    if not isinstance(document, dict):
        raise ServiceUnreachableError(f"{_asked(response)}: what answers there is not a RoboPrompt service")
    return document


def event_document(event: ServerSentEvent, response: httpx.Response) -> dict[str, Any]:
    """Return the JSON object of an event; raises ServiceUnreachableError for other data."""
    document = _json(event.data)
    if not isinstance(document, dict):
        what = f"the data of the event {event.event!r:.40} are not a JSON object: {event.data!r:.80}"
        raise ServiceUnreachableError(f"{_asked(response)}: {what}")
    return document


def _asked(response: httpx.Response) -> str:
    return f"{response.request.method} {response.url.copy_with(query=None)}"


def _json(data: str | bytes) -> object:
    """Return the decoded JSON, or None if it is not JSON."""
    try:
        return json.loads(data)
    except ValueError:
        return None


def request_parts(metadata: Mapping[str, Any], frames: Sequence[RgbdFrame]) -> dict[str, Part]:
    """Return the multipart files of a request: `metadata` as JSON, and every image of every frame.

    Images travel as JPEG and 16-bit PNG where OpenCV is installed (extra `images`), else as `.npy`.
    """
    encoded = _compressed if find_spec("cv2") else npy_part
    parts: dict[str, Part] = {"metadata": ("metadata.json", json.dumps(metadata).encode(), "application/json")}
    for frame in frames:
        parts |= {name: encoded(name, image, frame) for name, image in images_of(frame)}
    return parts


def prediction_request(
    task: str | None,
    instruction: str,
    observation: Observation,
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the body of `POST /predict` as arguments of httpx: JSON, or multipart where there are images."""
    document = {"task": task, "instruction": instruction, **scene_json(observation), **options}
    if (pose := observation.end_effector) is not None:
        document["end_effector"] = {"position": pose.position_m, "quaternion_xyzw": pose.quaternion_xyzw}
    if not observation.frames:
        return {"json": document}
    return {"files": request_parts(document, observation.frames)}


def images_of(frame: RgbdFrame) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Yield the frame's images with the names of their parts, such as `rgb_front`."""
    for kind, image in (("rgb", frame.rgb), ("depth", frame.depth_m), ("mask", frame.mask)):
        if image is not None:
            yield f"{kind}_{frame.camera.name}", image


def npy_part(name: str, image: np.ndarray[Any, Any], _: RgbdFrame) -> Part:
    """Return an image as a `.npy` file."""
    stream = io.BytesIO()
    np.save(stream, image, allow_pickle=False)
    return f"{name}.npy", stream.getvalue(), "application/octet-stream"


def npz_part(name: str, data: bytes) -> Part:
    """Return a `.npz` file, such as a trajectory's."""
    return f"{name}.npz", data, "application/octet-stream"


def _compressed(name: str, image: np.ndarray[Any, Any], frame: RgbdFrame) -> Part:
    import cv2

    if image is frame.rgb:
        return f"{name}.jpg", jpeg(cv2, image), "image/jpeg"
    if image is frame.depth_m:
        image = np.minimum(np.rint(image / frame.camera.depth_scale), _MAX_DEPTH_UNITS)
    return f"{name}.png", cv2.imencode(".png", image.astype(np.uint16))[1].tobytes(), "image/png"


def film_jpeg(cv2: Any, rgb: np.ndarray[Any, Any]) -> bytes:  # noqa: ANN401
    """Return a picture of a film: of a large image every second row and column, or fewer."""
    step = math.ceil(math.sqrt(rgb[..., 0].size / MAX_PICTURE_PIXELS))
    return jpeg(cv2, rgb[::step, ::step], FILM_QUALITY)


def jpeg(cv2: Any, rgb: np.ndarray[Any, Any], quality: int = JPEG_QUALITY) -> bytes:  # noqa: ANN401
    """Return an image (H, W, 3) of uint8, red first, as a JPEG file."""
    return bytes(cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes())


def scene_json(observation: Observation) -> dict[str, Any]:
    """Return `objects` (with a pose, with mask ids, or only a name to be found) and `cameras` of a request."""
    if not isinstance(observation, Observation):
        raise InvalidInputError("observation", f"is a {type(observation).__name__}", "Observation(poses)")
    unnamed = {name: list(ids) for name, ids in observation.mask_ids.items()}
    objects: list[dict[str, Any]] = [object_json(pose) for pose in observation.objects]
    objects += [{"name": name} for name in observation.to_find]
    for item in objects:
        if (ids := unnamed.pop(item["name"], None)) is not None:
            item["mask_ids"] = ids
    objects += [{"name": name, "mask_ids": ids} for name, ids in unnamed.items()]
    return {"objects": objects, "cameras": [camera_json(frame.camera) for frame in observation.frames]}
