"""A run of which only the report stays."""

import tempfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from rich.progress import Progress

from app.evaluation.executors import LocalExecutor
from app.evaluation.illustrate import illustrated
from app.evaluation.ledger import Ledger
from app.evaluation.plan import Plan
from app.evaluation.records import Evaluation
from app.evaluation.run import Run
from app.evaluation.server import service


def run_demo(plan: Plan, progress: Progress) -> Evaluation:
    """Run the plan on a service of its own; with pictures for the report.

    Raises:
        ServerStartError, ServiceLostError.
    """
    with (
        tempfile.TemporaryDirectory(prefix="roboprompt-") as folder,
        Ledger(Path(folder) / "results.jsonl") as ledger,
        closing(LocalExecutor()) as executor,
        service(warm_up=plan.asks_default_model) as client,
    ):
        evaluation = Run(plan, ledger, client, executor, progress)()
        return replace(evaluation, tasks=tuple(illustrated(evaluation, executor, progress)))
