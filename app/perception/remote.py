"""Poses from a server over HTTP: FoundationPose, a detector on a GPU, another instance of this service.

A request has a deadline and is retried while the server is busy; the server's refusal becomes this service's own error.
"""

import asyncio
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import httpx

from app.perception.base import ObjectQuery, model_of
from app.perception.models import RemoteModel
from app.perception.poses_wire import Part, PoseAnswer, answers_from_json, request_parts
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.errors import NoPoseError, ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.errors import InvalidInputError, RoboPromptError
from roboprompt_client.http import without_proxy
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

EXAMPLE = '{"estimator": "remote", "url": "http://127.0.0.1:8000/poses"}'
FIRST_PAUSE_S = 0.2  # doubled for each retry
MAX_REPLY_BYTES = 1_000_000  # a pose takes 300
MAX_SHOWN_CHARS = 300
BUSY = frozenset({429, 502, 503, 504})
# The service's own problems of objects without a pose (RFC 9457), by the end of their type
NO_POSE: Mapping[str, type[NoPoseError]] = {
    "object-not-visible": ObjectNotVisibleError,
    "uncertain-pose": UncertainPoseError,
}
OBJECT_FIELD = re.compile(r"objects\[(.+)\]")
Asked = tuple[ObjectQuery, RemoteModel]


class PoseServerError(RoboPromptError):
    """A pose server failed."""


class PoseServerUnavailableError(PoseServerError):
    """The server cannot be reached or is not ready."""


class PoseServerTimeoutError(PoseServerError):
    """The server did not answer within the object model's timeout_s."""


class PoseServerReplyError(PoseServerError):
    """The server answered with an error or an invalid reply."""


class _NotReadyError(Exception):
    """The request should be retried."""

    def __init__(self, reason: str, pause_s: float = 0.0) -> None:
        super().__init__(reason)
        self.pause_s = pause_s


@dataclass(frozen=True)
class PoseServer:
    """A pose server at the address `url`; `timeout_s` is the deadline of a request, retries included."""

    url: str
    timeout_s: float

    async def ask(self, parts: Mapping[str, Part]) -> Any:  # noqa: ANN401
        """Return the reply's JSON document.

        Raises:
            InvalidInputError: if the server refuses the request (422), with the server's reason.
            PoseServerUnavailableError: if it could not be reached, or was busy, until the end of `timeout_s`.
            PoseServerTimeoutError: if it accepted the request but did not answer within `timeout_s`.
            PoseServerReplyError: for any other status, and for a reply that is not JSON or too large.
        """
        trouble = ""
        try:
            async with asyncio.timeout(self.timeout_s), self._client() as client:
                pause_s = FIRST_PAUSE_S
                while True:
                    try:
                        return await self._try(client, parts)
                    except _NotReadyError as error:
                        trouble = str(error)
                        await asyncio.sleep(max(pause_s, error.pause_s))
                        pause_s *= 2
        except TimeoutError:
            if trouble:
                message = f"the pose server {self.url} was not ready for {self.timeout_s:g} s: {trouble}"
                raise PoseServerUnavailableError(message) from None
            message = f"the pose server {self.url} did not answer within {self.timeout_s:g} s"
            raise PoseServerTimeoutError(message) from None

    def _client(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(
            headers={"Accept-Encoding": "identity"},  # no compression, which could expand without bound
            timeout=None,  # the deadline covers everything
            verify=self.url.startswith("https:"),  # reading the certificates takes 20 to 90 ms
            mounts=without_proxy(self.url),
        )

    async def _try(self, client: httpx.AsyncClient, parts: Mapping[str, Part]) -> Any:  # noqa: ANN401
        try:
            async with client.stream("POST", self.url, files=dict(parts)) as response:
                body = await _read(response)
        except httpx.TransportError as error:
            raise _NotReadyError(str(error) or type(error).__name__) from error
        except httpx.HTTPError as error:
            raise PoseServerReplyError(f"the reply of {self.url} cannot be read: {error}") from error
        if response.status_code in BUSY:
            pause_s = response.headers.get("retry-after", "")
            raise _NotReadyError(_shown(response, body), float(pause_s) if pause_s.isdecimal() else 0.0)
        try:
            document = json.loads(body)
        except (ValueError, RecursionError):
            document = None
        if response.status_code == httpx.codes.UNPROCESSABLE_ENTITY:
            raise self._refusal(response, body, document)
        if response.status_code != httpx.codes.OK or document is None:
            raise PoseServerReplyError(f"the pose server {self.url} answered {_shown(response, body)}")
        return document

    def _refusal(self, response: httpx.Response, body: bytes, problem: object) -> InvalidInputError:
        """Return the error of a 422; if the server is of this service, the same error as there."""
        if not isinstance(problem, dict) or not isinstance(problem.get("errors"), list) or not problem["errors"]:
            return InvalidInputError("cameras", f"the pose server {self.url} refused them: {_shown(response, body)}")
        first = problem["errors"][0] if isinstance(problem["errors"][0], dict) else {}
        type_ = str(problem.get("type", "")).rpartition("/")[2]
        message = f"{_cut(first.get('message'))} (says the pose server {self.url})"
        field, valid = _cut(first.get("field")) or "cameras", _cut(first.get("valid")) or None
        if (named := OBJECT_FIELD.fullmatch(field)) and (no_pose := NO_POSE.get(type_)):
            return no_pose(named[1], message, valid)
        return InvalidInputError(field, message, valid)


async def _read(response: httpx.Response) -> bytes:
    body = b""
    async for chunk in response.aiter_raw():
        body += chunk
        if len(body) > MAX_REPLY_BYTES:
            raise PoseServerReplyError(f"{response.url} replied with more than {MAX_REPLY_BYTES} bytes")
    return body


def _shown(response: httpx.Response, body: bytes) -> str:
    return f"HTTP {response.status_code}: {_cut(body.decode(errors='replace'))}"


def _cut(text: object) -> str:
    return "" if text is None else str(text)[:MAX_SHOWN_CHARS]


class RemotePoses:
    """Requests poses from each object's server, concurrently. Call it in a thread without an event loop.

    Raises PoseServerError if a server fails, besides the errors of every estimator.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        asked = [(query, model_of(query, RemoteModel, EXAMPLE)) for query in objects]
        if not any(frame.rgb is not None or frame.depth_m is not None for frame in frames):
            raise InvalidInputError("cameras", "no camera has an image", "rgb_NAME and depth_NAME")
        servers: dict[PoseServer, list[Asked]] = {}
        for query, model in asked:
            servers.setdefault(PoseServer(model.url, model.timeout_s), []).append((query, model))
        poses = asyncio.run(_ask_all(servers, frames))
        return tuple(poses[query.name] for query in objects)


async def _ask_all(servers: Mapping[PoseServer, Sequence[Asked]], frames: Sequence[RgbdFrame]) -> dict[str, ObjectPose]:
    answers = await asyncio.gather(*(_ask(server, asked, frames) for server, asked in servers.items()))
    return {pose.name: pose for poses in answers for pose in poses}


async def _ask(server: PoseServer, asked: Sequence[Asked], frames: Sequence[RgbdFrame]) -> list[ObjectPose]:
    objects = [{"name": query.name, "mask_ids": query.mask_ids, "model": model.model} for query, model in asked]
    reply = await server.ask(request_parts(objects, frames))
    names, cameras = [query.name for query, _ in asked], [frame.camera.name for frame in frames]
    try:
        answers = answers_from_json(reply, names, cameras)
    except InvalidInputError as error:
        raise PoseServerReplyError(f"the reply of {server.url} is not as it should be: {error}") from error
    return [_fused(query, model, [item for item in answers if item.name == query.name]) for query, model in asked]


def _fused(query: ObjectQuery, model: RemoteModel, answers: Sequence[PoseAnswer]) -> ObjectPose:
    """Return the fused pose of the server's answers for one object, each treated as a camera's sighting."""
    named = [(" and ".join(item.cameras) or model.url, item) for item in answers]
    found = [
        Miss(camera, item.reason or "not found")
        if item.position_m is None
        else Sighting(camera, item.position_m, item.quaternion_xyzw, item.confidence, item.reason)
        for camera, item in named
    ]
    pose = fused(query, found, estimator="remote", min_confidence=model.min_confidence)
    seen = [name for camera, item in named if camera in pose.cameras for name in item.cameras]
    return replace(pose, cameras=tuple(dict.fromkeys(seen)))
