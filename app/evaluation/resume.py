"""What a ledger has of a plan, and whether the two belong together."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.evaluation.errors import OtherModelError
from app.evaluation.ledger import Ledger
from app.evaluation.plan import Plan
from app.evaluation.records import Crash, Evaluation, TaskEvaluation, Trial
from app.evaluation.teach import Lesson


def evaluation_of(
    plan: Plan,
    ledger: Ledger,
    taught: Mapping[str, Lesson] | None = None,
    duration_s: float = 0.0,
    models: Sequence[Mapping[str, Any]] = (),
) -> Evaluation:
    """What the ledger has of the plan."""
    outcomes = [outcome for cell in plan.cells() if (outcome := plan.outcome(ledger, cell)) is not None]
    tasks = tuple(
        TaskEvaluation(
            task,
            taught[task].taught if taught and task in taught else (),
            tuple(outcome for outcome in outcomes if isinstance(outcome, Trial) and outcome.task == task),
            tuple(outcome for outcome in outcomes if isinstance(outcome, Crash) and outcome.task == task),
        )
        for task in plan.tasks
    )
    return Evaluation(plan.command, plan.methods, tasks, duration_s, tuple(models))


def check_default_model(plan: Plan, ledger: Ledger, models: Sequence[Mapping[str, Any]]) -> None:
    """Refuse to go on with another LLM where methods leave it to the service.

    Raises:
        OtherModelError.
    """
    default = next(model["name"] for model in models if model["default"])
    for cell in plan.cells():
        outcome = plan.outcome(ledger, cell)
        if not cell.method.asks_service or "model" in cell.method.options or not isinstance(outcome, Trial):
            continue
        used = (outcome.answer or {"model": default})["model"]
        if used != default:
            remedy = f"give --model {used}, or another folder"
            raise OtherModelError(f"the results are of {used}, but the service's default model is {default}: {remedy}")
