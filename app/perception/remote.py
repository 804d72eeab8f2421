"""Poses from a server, asked over HTTP: FoundationPose, a detector on a GPU, another instance of this service."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace

from app.perception.base import ObjectQuery
from app.perception.errors import PoseServerReplyError
from app.perception.pose_server import PoseServer
from app.perception.poses_wire import PoseAnswer, PoseQuestion, answers_from_json, request_parts
from app.perception.remote_model import RemoteModel
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError

Asked = tuple[ObjectQuery, RemoteModel]


class RemotePoses:
    """Asks each object's server; several servers are asked at once. Call it in a thread without an event loop.

    Raises PoseServerError, besides what every estimator raises, if a server does not answer as it should.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        asked = [(query, _model(query)) for query in objects]
        if not any(frame.rgb is not None or frame.depth_m is not None for frame in frames):
            raise InvalidInputError("cameras", "no camera has an image", "rgb_NAME and depth_NAME")
        poses = asyncio.run(_ask_all(asked, frames))
        return tuple(poses[query.name] for query in objects)


def _model(query: ObjectQuery) -> RemoteModel:
    if not isinstance(query.model, RemoteModel):
        what = "is missing" if query.model is None else f"is for the estimator {query.model.estimator!r}"
        remedy = '{"estimator": "remote", "url": "http://127.0.0.1:8000/poses"}'
        raise InvalidInputError(f"object_models[{query.name}]", what, remedy)
    return query.model


async def _ask_all(asked: Sequence[Asked], frames: Sequence[RgbdFrame]) -> dict[str, ObjectPose]:
    servers: dict[PoseServer, list[Asked]] = {}
    for query, model in asked:
        servers.setdefault(PoseServer(model.url, model.timeout_s), []).append((query, model))
    results = await asyncio.gather(*(_ask(server, group, frames) for server, group in servers.items()))
    return {pose.name: pose for poses in results for pose in poses}


async def _ask(server: PoseServer, asked: Sequence[Asked], frames: Sequence[RgbdFrame]) -> list[ObjectPose]:
    questions = [PoseQuestion(query.name, query.mask_ids, model.model) for query, model in asked]
    reply = await server.ask(request_parts(questions, frames))
    names, cameras = [query.name for query, _ in asked], [frame.camera.name for frame in frames]
    try:
        answers = answers_from_json(reply, names, cameras)
    except InvalidInputError as error:
        raise PoseServerReplyError(f"the reply of {server.url} is not as it should be: {error}") from error
    return [_fused(query, model, [item for item in answers if item.name == query.name]) for query, model in asked]


def _fused(query: ObjectQuery, model: RemoteModel, answers: Sequence[PoseAnswer]) -> ObjectPose:
    """The server's answers on one object, as if each came from a camera."""
    pose = fused(
        query,
        [
            Sighting(_seen_by(model, item), item.position_m, item.quaternion_xyzw, item.confidence, item.reason)
            for item in answers
            if item.position_m is not None
        ],
        [Miss(_seen_by(model, item), item.reason or "not found") for item in answers if item.position_m is None],
        estimator="remote",
        min_confidence=model.min_confidence,
    )
    seen = [name for item in answers if _seen_by(model, item) in pose.cameras for name in item.cameras]
    return replace(pose, cameras=tuple(dict.fromkeys(seen)))


def _seen_by(model: RemoteModel, answer: PoseAnswer) -> str:
    return " and ".join(answer.cameras) or model.url
