"""The question that is put to an LLM: a request, what is known of it, and the prompt that was written of both."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.pipeline.episode import Query
from app.pipeline.findings import Finding
from app.pipeline.order.order import Order
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.prompt import Prompt, PromptTemplate
from app.services.predict.known import Known
from app.services.predict.prefix import Prefix
from app.services.predict.request import PredictRequest


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that is fixed before the LLM is asked.

    Attributes:
        request: without what was decoded.
        grounded: the instruction as it is understood.
        seen: the same of the task's objects as they were found, in the task's order.
        parts: what is asked for one after the other, of the objects as the prompt has them: with rotations where
            demonstrations have them.
        prefix: what the LLM reads before the query.
        template: writes the query and reads the reply, at the step that is asked for.
        step: of a closed loop, from 0; None without one.
        prompt: asks for the first of the parts.
        plans: by instruction of a part, the demonstrated rows in the observed scene; None where they are unknown.
        turned: whether actions have the hand turned by half a turn from what a reply says, as `plans` have.
        findings: what is doubtful before anything is asked.
        samples: where several replies are asked for, the same question for each, with a seed of its own.
    """

    request: PredictRequest
    known: Known
    grounded: Order
    seen: Query
    parts: tuple[Query, ...]
    prefix: Prefix
    template: PromptTemplate
    step: int | None
    prompt: Prompt
    plans: Mapping[str, tuple[PlacedPlan, ...] | None]
    turned: bool = False
    findings: tuple[Finding, ...] = ()
    samples: tuple["Question", ...] = ()

    @property
    def deadline_s(self) -> float:
        """How long the answer may take."""
        return self.request.options.deadline_s(self.known.profile, len(self.prompt.system) + len(self.prompt.user))
