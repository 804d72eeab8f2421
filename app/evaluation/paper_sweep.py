"""The sweep `paper`: tables in the paper's layout, with the traffic to the LLM recorded beside them."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rich.progress import Progress

from app.evaluation.costs import Prices, Usage
from app.evaluation.estimates import by_table
from app.evaluation.executors import Executor
from app.evaluation.ledger import Ledger
from app.evaluation.paid_run import PaidRun
from app.evaluation.paper_layout import paper_markdown
from app.evaluation.paper_tables import PaperPlan, PaperTable
from app.evaluation.results import Evaluation
from app.evaluation.run import Timing
from app.evaluation.sweep_run import SweepRun
from roboprompt_client.client import RoboPromptClient

RECORD, REPLAY = "ROBOPROMPT_RECORD_LLM", "ROBOPROMPT_REPLAY_LLM"
Estimate = Sequence[tuple[PaperTable, int, Usage]]


@dataclass(frozen=True)
class PaperSweep(SweepRun):
    """One session of some of the paper's tables in a folder of results.

    Attributes:
        plan: a PaperPlan.
        confirm: called with the estimate before an LLM is asked; raises to refuse.
        budget: of this session, in the currency of the prices.
    """

    plan: PaperPlan
    confirm: Callable[[Estimate], None] = field(kw_only=True)
    prices: Prices = field(default_factory=dict)
    budget: float | None = None

    @property
    def environment(self) -> Mapping[str, str]:
        """Traffic goes into the folder, unless it comes from recordings or goes elsewhere already."""
        if any(os.environ.get(name) for name in (RECORD, REPLAY)):
            return {}
        return {RECORD: str((self.folder / "llm").absolute())}

    def _begin(
        self, ledger: Ledger, client: RoboPromptClient, executor: Executor, progress: Progress, timing: Timing
    ) -> PaidRun:
        def confirm(kinds: Mapping[tuple[str, str], Usage]) -> None:
            self.confirm(by_table(self.plan, self.plan.remaining(ledger), kinds))

        return PaidRun(
            self.plan,
            ledger,
            client,
            executor,
            progress,
            timing=timing,
            confirm=confirm,
            prices=self.prices,
            budget=self.budget,
        )

    def _write_results(self, evaluation: Evaluation) -> None:
        self.tables.write_text(paper_markdown(self.plan, evaluation, self.prices), encoding="utf-8")

    @property
    def tables(self) -> Path:
        """The file with the tables."""
        return self.folder / "table.md"
