"""The step of a closed loop that a request goes on from: the next prompt continues its prompt and reply."""

from dataclasses import dataclass

from sqlalchemy import Connection

from app.pipeline.order.order import Order
from app.services.predict.request import PredictRequest, PromptStyle
from app.store import predictions
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import ObjectPose


@dataclass(frozen=True)
class PreviousStep:
    """A closed loop's last prediction.

    Attributes:
        step: its number, from 0.
        prompt_user, reply_text: as the LLM read and wrote them.
        end_effector: where its action sent it.
        instruction, grounded: as it was asked, and how it was understood.
        objects: as they were observed.
    """

    step: int
    model: str
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    prompt_user: str
    reply_text: str
    end_effector: Pose
    instruction: str
    grounded: Order
    objects: tuple[ObjectPose, ...] = ()


def previous_step(connection: Connection, request: PredictRequest) -> PreviousStep | None:
    """The prediction that a closed loop goes on from; None for a request that begins.

    Raises:
        NotFoundError: if there is no such prediction.
        InvalidInputError: if it is none that a closed loop of this task can go on from.
    """
    if request.options.after is None:
        return None
    record = predictions.get(connection, request.options.after)
    valid = "the id of the last step of a closed loop that goes on"
    if record.task != request.task:
        raise InvalidInputError("after", f"is a prediction of the task {record.task!r}", valid)
    if record.step is None or record.reply_text is None or record.actions is None:
        raise InvalidInputError("after", "is not a step of a closed loop that gave an action", valid)
    if not record.actions:
        raise InvalidInputError("after", "is a step that ended its closed loop", valid)
    last = record.actions[-1]
    return PreviousStep(
        record.step,
        record.model,
        PromptStyle(record.representation, record.prompt_format, record.prompt_system, closed_loop=True),
        record.demonstration_ids,
        record.prompt_user,
        record.reply_text,
        Pose(tuple(last["position"]), tuple(last["quaternion_xyzw"])),
        record.instruction,
        Order.from_json(record.grounding, [item.name for item in record.objects]),
        tuple(item.pose() for item in record.objects),
    )
