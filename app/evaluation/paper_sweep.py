"""The sweep `paper`: its estimate, its traffic with the LLM, and its tables as the paper prints them.

Methods stand in rows and tasks in columns, our rows below the paper's.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean

from rich.table import Table

from app.evaluation.costs import Kinds, Prices, Purse, Usage, kind_of, used_by
from app.evaluation.ledger import Ledger
from app.evaluation.methods import Method
from app.evaluation.paper_tables import PaperPlan, PaperTable
from app.evaluation.results import Evaluation, TaskEvaluation
from app.evaluation.scores import NOTHING, Score, task_result, trials_of
from app.evaluation.sweep_run import SweepRun
from app.evaluation.tables import TextTable, errors_section
from app.evaluation.trials import PlannedTrial

RECORD, REPLAY = "ROBOPROMPT_RECORD_LLM", "ROBOPROMPT_REPLAY_LLM"
Estimate = Sequence[tuple[PaperTable, int, Usage]]
COLUMNS = 8  # tasks side by side, as in Table I
# The rows of the paper's tables, ours below theirs; what is not named here follows in its own order.
ORDER = ("RVT-2", "Act3D", "VoxPoser", "KAT")
HOW_TO_READ = (
    "Success in percent. Rows `paper` are the paper's (arXiv 2410.12782), from RLBench and a real robot; rows `here`"
    " are from this project's MuJoCo scenes, which are counterparts and not RLBench itself. Where trials are missing,"
    " successes and trials stand in brackets: errors are trials that could not be run, and count neither way."
)


def paper_markdown(plan: PaperPlan, evaluation: Evaluation, prices: Prices) -> str:
    """The contents of `table.md`."""
    by_task = {task.task: task for task in evaluation.tasks}
    sections = [part for table in plan.tables for part in _section(plan, table, by_task)]
    used = TextTable(["method", "answers", "read", "written", "cost"], [list(_usage_rows(evaluation, prices))])
    parts = [
        "# The paper's tables",
        HOW_TO_READ,
        *sections,
        "## Tokens",
        "As the provider counted them; cached ones are priced as the others.",
        used.markdown(),
        *errors_section(evaluation),
        f"Command: `{evaluation.command}`",
    ]
    return "\n\n".join(parts) + "\n"


def _section(plan: PaperPlan, table: PaperTable, by_task: Mapping[str, TaskEvaluation]) -> Iterator[str]:
    kind = "Figure" if table.name[0].isdigit() else "Table"
    yield f"## {kind} {table.name}: {table.title}"
    scores = [(m, [_score(plan, table, by_task[task], m) for task in table.tasks]) for m in table.methods]
    columns = table.tasks if table.published else ()
    rows = list(_rows(table, scores))
    for start in range(0, len(columns) or 1, COLUMNS):
        part, last = columns[start : start + COLUMNS], start + COLUMNS >= len(columns)
        header = ["", *part, *(["mean"] if last else [])]
        yield TextTable(header, [[[label, *_cut(cells, start, len(part), last)] for label, cells in rows]]).markdown()
    names = ", ".join(table.tasks)
    yield f"{table.note} {table.episodes} scenes each of: {names}."


def _cut(cells: Sequence[str], start: int, number: int, last: bool) -> list[str]:
    """The columns of one block; the mean is the last of `cells`."""
    return [*cells[start : start + number], *(cells[-1:] if last else [])]


def _rows(table: PaperTable, scores: Sequence[tuple[Method, Sequence[Score]]]) -> Iterator[tuple[str, list[str]]]:
    """Label and cells of each row: the tasks', if the table shows them, and the mean."""
    ours = {method.label: (method, row) for method, row in scores}
    names = dict.fromkeys([*(n for n in ORDER if n in table.published), *table.published, *table.means])
    names.pop(first := "RoboPrompt", None)
    last = [first] if first in table.published or first in table.means else []
    for name in [*names, *last]:
        yield f"{name}, paper", _published(table, name)
        if name in ours:
            yield _here(table, *ours.pop(name))
    for method, row in ours.values():
        yield _here(table, method, row)


def _published(table: PaperTable, name: str) -> list[str]:
    row = table.published.get(name)
    if row is None:
        return [f"{table.means[name]:.1f}"]
    return [*(f"{row[task]:g}" for task in table.tasks), f"{fmean(row[task] for task in table.tasks):.1f}"]


def _here(table: PaperTable, method: Method, row: Sequence[Score]) -> tuple[str, list[str]]:
    model = method.options["model"]
    label = f"{model}, here" if table.name == "III" else f"{method.label}, here ({model})"
    cells = [_cell(score, table.episodes) for score in row] if table.published else []
    return label, [*cells, _mean(row)]


def _cell(score: Score, episodes: int) -> str:
    rate = score.rate
    if not rate.trials:
        return score.not_run or NOTHING
    missing = [] if rate.trials == episodes else [f"{rate.successes}/{rate.trials}"]
    noted = ", ".join([*missing, *([score.not_run] if score.not_run else [])])
    return f"{100 * rate.rate:.0f}" + (f" ({noted})" if noted else "")


def _mean(row: Sequence[Score]) -> str:
    rates = [score.rate.rate for score in row if score.rate.trials]
    if not rates:
        return NOTHING
    some = "" if len(rates) == len(row) else f" ({len(rates)} of {len(row)} tasks)"
    return f"{100 * fmean(rates):.1f}{some}"


def _score(plan: PaperPlan, table: PaperTable, task: TaskEvaluation, method: Method) -> Score:
    """Of the table's scenes; another table may have more."""
    end = plan.first_test_seed + table.episodes
    some = replace(
        task,
        trials=tuple(trial for trial in task.trials if trial.seed < end),
        crashes=tuple(crash for crash in task.crashes if crash.seed < end),
    )
    return task_result(some, method).score


def _usage_rows(evaluation: Evaluation, prices: Prices) -> Iterator[list[str]]:
    total, answers = Usage(), 0
    for method in evaluation.methods:
        answered = [trial for trial in trials_of(evaluation, method) if trial.answer is not None]
        usage = sum((used_by(trial, prices) for trial in answered), Usage())
        total, answers = total + usage, answers + len(answered)
        yield _usage_row(method.label, len(answered), usage)
    yield _usage_row("all", answers, total)


def _usage_row(label: str, answers: int, usage: Usage) -> list[str]:
    return [label, str(answers), f"{usage.read:,.0f}", f"{usage.written:,.0f}", shown_cost(usage.cost)]


def shown_cost(cost: float | None) -> str:
    """In the currency of the prices."""
    return NOTHING if cost is None else f"{cost:,.2f}" if cost >= 1 else f"{cost:.3g}"


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
