"""The body of a request that asks for actions -> the question, for the API and the pages."""

import anyio.to_thread

from app.api.body import Body
from app.api.frames import decode_frames, decoded, split_images
from app.api.schemas.requests import PredictBody
from app.services.container import Services
from app.services.predict.request import PredictRequest


async def questioned(body: Body, services: Services) -> tuple[PredictRequest, PredictBody]:
    """Return the question, with its task.

    Images are decoded in a thread, for which a small JSON body does not repay the change.
    """
    query, asked = await decoded(services, _read_question, body) if body.parts else _read_question(body)
    if asked.task is None:
        query = await anyio.to_thread.run_sync(services.read_steps.with_task, query)
    return query, asked


def _read_question(body: Body) -> tuple[PredictRequest, PredictBody]:
    """Return the question, checked and decoded; synchronous: call it in a thread if there are images."""
    asked = PredictBody.model_validate(body.document)
    images = split_images(asked.cameras, body.parts)
    query = PredictRequest(
        task=asked.task or "",
        instruction=asked.instruction,
        objects=tuple(item.query() for item in asked.objects),
        frames=decode_frames(asked.cameras, images),
        images=images,
        end_effector=None if asked.end_effector is None else asked.end_effector.pose(),
        options=asked,
        as_sent=asked.model_dump(mode="json", exclude_unset=True),
    )
    return query, asked
