"""The step before, which a closed loop goes on from."""

from dataclasses import dataclass

from sqlalchemy import Connection

from app.pipeline.errors import InvalidInputError
from app.pipeline.language.grounding import Grounded
from app.pipeline.motion_limits import Pose
from app.services.templates import PromptStyle, Template
from app.store import predictions
from app.store.errors import ConflictError


@dataclass(frozen=True)
class PreviousStep:
    """A closed loop's last prediction.

    Attributes:
        step: its number, from 0.
        prompt_user, reply_text: as the LLM read and wrote them.
        end_effector: where its action sent it.
        instruction, grounded: as it was asked, and how it was understood, where that was kept.
    """

    step: int
    model: str
    style: PromptStyle
    demonstration_ids: tuple[str, ...]
    prompt_user: str
    reply_text: str
    end_effector: Pose
    instruction: str
    grounded: Grounded | None

    def so_far(self, template: Template) -> str:
        """What follows the demonstrations in the next prompt: every observation and action until now.

        Raises:
            ConflictError: if the demonstrations do not read as they did.
        """
        prefix = template.prompt.prefix
        if not self.prompt_user.startswith(prefix):
            raise ConflictError("the demonstrations have changed since the last step: begin the closed loop again")
        codec = template.at_step(self.step).codec
        reply = codec.reply_text(codec.rows(self.reply_text, complete=True))
        return f"{self.prompt_user[len(prefix) :]}{reply}{codec.separator}"


def previous_step(connection: Connection, prediction_id: str, task: str) -> PreviousStep:
    """The prediction that a closed loop goes on from.

    Raises:
        NotFoundError: if there is no such prediction.
        InvalidInputError: if it is none that a closed loop of this task can go on from.
    """
    record = predictions.get(connection, prediction_id)
    valid = "the id of the last step of a closed loop that goes on"
    if record.task != task:
        raise InvalidInputError("after", f"is a prediction of the task {record.task!r}", valid)
    if record.step is None or record.reply_text is None or record.actions is None:
        raise InvalidInputError("after", "is not a step of a closed loop that gave an action", valid)
    if not record.actions:
        raise InvalidInputError("after", "is a step that ended its closed loop", valid)
    style = PromptStyle(record.representation, record.prompt_format, record.prompt_system, closed_loop=True)
    last = record.actions[-1]
    return PreviousStep(
        record.step,
        record.model,
        style,
        record.demonstration_ids,
        record.prompt_user,
        record.reply_text,
        Pose(tuple(last["position"]), tuple(last["quaternion_xyzw"])),
        record.instruction,
        None if record.grounding is None else Grounded.from_json(record.grounding),
    )
