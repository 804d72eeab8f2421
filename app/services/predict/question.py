"""The question that is put to an LLM: a request, what is known of it, and the prompt that was written of both."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.llm.base import ModelProfile
from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.prompt import Prompt, PromptTemplate
from app.services.predict.prefix import Prefix
from app.services.predict.request import PredictRequest, PromptStyle
from app.services.task_settings import TaskSettings
from roboprompt_client.motion_limits import Pose
from roboprompt_client.trajectory import ObjectPose


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        request: without what was decoded.
        settings: of the task.
        profile: of the model that is asked.
        grounded: the instruction as it is understood.
        seen: the same of the task's objects as they were found, in the task's order.
        bystanders: other objects, which the hand must not hit.
        parts: what is asked for one after the other, of the objects as the prompt has them: with rotations where
            demonstrations have them.
        end_effector: where it is before the first action: as the robot tells, else where the last step sent it.
        prefix: what the LLM reads before the query.
        taught: what the answer is held against.
        template: writes the query and reads the reply, at the step that is asked for.
        so_far: the steps of a closed loop that were taken already.
        step: of a closed loop, from 0; None without one.
        prompt: asks for the first of the parts.
        plans: by instruction of a part, the demonstrated rows in the observed scene; None where they are unknown.
        turned: whether actions have the hand turned by half a turn from what a reply says, as `plans` have.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    settings: TaskSettings
    profile: ModelProfile
    style: PromptStyle
    grounded: Order
    seen: Query
    bystanders: tuple[ObjectPose, ...]
    parts: tuple[Query, ...]
    end_effector: Pose | None
    prefix: Prefix
    taught: Taught
    template: PromptTemplate
    so_far: str
    step: int | None
    prompt: Prompt
    plans: Mapping[str, tuple[PlacedPlan, ...] | None]
    turned: bool = False
    findings: tuple[Finding, ...] = ()
    samples: tuple["Question", ...] = ()

    @property
    def deadline_s(self) -> float:
        """How long the answer may take."""
        return self.request.options.deadline_s(self.profile, len(self.prompt.system) + len(self.prompt.user))
