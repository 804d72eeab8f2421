"""The sweep `paper`: its estimate, its one session after another, and its traffic recorded beside the tables."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from rich.table import Table

from app.evaluation.costs import Kinds, Prices, Purse, Usage, kind_of
from app.evaluation.ledger import Ledger
from app.evaluation.paper_layout import paper_markdown, shown_cost
from app.evaluation.paper_tables import PaperPlan, PaperTable
from app.evaluation.results import Evaluation
from app.evaluation.sweep_run import SweepRun
from app.evaluation.tables import TextTable
from app.evaluation.trials import PlannedTrial

RECORD, REPLAY = "ROBOPROMPT_RECORD_LLM", "ROBOPROMPT_REPLAY_LLM"
Estimate = Sequence[tuple[PaperTable, int, Usage]]


@dataclass(frozen=True)
class PaperSweep(SweepRun):
    """One session of some of the paper's tables in a folder of results, with the LLM's traffic recorded there.

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

    def purse(self, ledger: Ledger) -> Purse:
        """Pays for the trials, once the estimate of what remains is confirmed."""

        def confirm(kinds: Kinds) -> None:
            self.confirm(by_table(self.plan, self.plan.remaining(ledger), kinds))

        return Purse(self.budget, self.prices, confirm)

    def write_results(self, evaluation: Evaluation) -> None:
        """The tables in the paper's layout."""
        text = paper_markdown(self.plan, evaluation, self.prices)
        (self.folder / "table.md").write_text(text, encoding="utf-8")


def by_table(plan: PaperPlan, remaining: Sequence[PlannedTrial], kinds: Kinds) -> list[tuple[PaperTable, int, Usage]]:
    """How many of the trials each table adds, and what they use. A shared trial counts for the first table."""
    wanted = {planned.key for planned in remaining}
    rows = {table.name: (table, 0, Usage()) for table in plan.tables}
    for table, planned in plan.trials_by_table():
        if planned.key in wanted:
            _, number, usage = rows[table.name]
            rows[table.name] = table, number + 1, usage + kinds.get(kind_of(planned), Usage())
    return list(rows.values())


def estimate_table(rows: Sequence[tuple[PaperTable, int, Usage]]) -> Table:
    """For people, with the sum in the last row."""
    header = ("table", "trials", "requests", "tokens read", "tokens written", "cost")
    total = sum((usage for *_, usage in rows), Usage())
    groups = [
        [[table.name, *_cells(number, usage)] for table, number, usage in rows],
        [["all", *_cells(sum(number for _, number, _ in rows), total)]],
    ]
    return TextTable(header, groups).terminal("estimate, before anything is asked")


def _cells(number: int, usage: Usage) -> tuple[str, ...]:
    counts = (number, usage.requests, usage.read, usage.written)
    return *(f"{count:,.0f}" for count in counts), shown_cost(usage.cost)
