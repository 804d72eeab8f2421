"""What a plan is going to cost: requests and tokens of each method on each task, from dry runs of their prompts.

A reply is taken to be as long as one of the prompt's demonstrations with its observation, for each clause of the
instruction: a little more than it is. Tokens that a model thinks are not foreseen.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from rich.box import SIMPLE_HEAD
from rich.table import Table

from app.evaluation.costs import Prices, Usage, tokens_of
from app.evaluation.paper_tables import PaperPlan, PaperTable
from app.evaluation.scores import NOTHING
from app.evaluation.teach import Lesson
from app.evaluation.trials import Cell
from app.pipeline.order.order import clause_texts
from app.sim.demonstrate import SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation

Kind = tuple[str, str]  # task, label of the method
LessonOf = Callable[[Cell], Lesson | Exception]


def kind_of(cell: Cell) -> Kind:
    """What trials of like cost have in common."""
    return cell.task, cell.method.label


def estimates(
    client: RoboPromptClient,
    cells: Iterable[Cell],
    lesson_of: LessonOf,
    look: Callable[[Cell], SceneView],
    prices: Prices,
) -> dict[Kind, Usage]:
    """What one trial of each kind uses; without those that could not be taught, which ask nobody.

    Raises:
        ServiceProblemError, ServiceUnreachableError: if the service writes no prompt.
    """
    longest: dict[str, SceneView] = {}
    found: dict[Kind, Usage] = {}
    cells = list(cells)
    for cell in {(cell.task, cell.seed): cell for cell in cells}.values():
        scene = look(cell)
        known = longest.setdefault(cell.task, scene)
        longest[cell.task] = max(known, scene, key=lambda view: len(clause_texts(view.instruction)))
    for cell in {kind_of(cell): cell for cell in cells}.values():
        if isinstance(lesson := lesson_of(cell), Lesson):
            usage = _of_a_trial(client, cell, lesson, longest[cell.task])
            price = prices.get(cell.method.options["model"])
            cost = None if price is None else price.of(usage.read, usage.written)
            found[kind_of(cell)] = replace(usage, cost=cost)
    return found


def _of_a_trial(client: RoboPromptClient, cell: Cell, lesson: Lesson, scene: SceneView) -> Usage:
    stepwise = cell.method.source == "closed loop"
    options = {**cell.method.options, **({"closed_loop": True} if stepwise else {})}
    answer = client.dry_run(lesson.name, scene.instruction, Observation(scene.objects), **options)
    prompt = answer["prompt"]
    read = tokens_of(prompt["system"]) + tokens_of(prompt["user"])
    parts = len(clause_texts(scene.instruction))
    demonstration = tokens_of(prompt["user"]) / max(1, len(answer["demonstration_ids"]))
    # a step for each keyframe of a demonstration, and one that says that there are no more
    requests = parts * max(len(item.document["keyframes"]) for item in lesson.taught) + 1 if stepwise else 1
    return Usage(requests, requests * read, parts * demonstration)


def by_table(
    plan: PaperPlan, cells: Sequence[Cell], kinds: Mapping[Kind, Usage]
) -> list[tuple[PaperTable, int, Usage]]:
    """How many of the trials each table adds, and what they use. A shared trial counts for the first table."""
    wanted = {(*kind_of(cell), cell.seed) for cell in cells}
    rows = {table.name: (table, 0, Usage()) for table in plan.tables}
    for table, cell in plan.cells_by_table():
        if (*kind_of(cell), cell.seed) in wanted:
            _, number, usage = rows[table.name]
            rows[table.name] = table, number + 1, usage + kinds.get(kind_of(cell), Usage())
    return list(rows.values())


def estimate_table(rows: Sequence[tuple[PaperTable, int, Usage]]) -> Table:
    """For people, with the sum in the last row."""
    table = Table(title="estimate, before anything is asked", box=SIMPLE_HEAD)
    for header in ("table", "trials", "requests", "tokens read", "tokens written", "cost"):
        table.add_column(header, justify="left" if header == "table" else "right")
    for paper_table, number, usage in rows:
        table.add_row(paper_table.name, *_cells(number, usage))
    table.add_section()
    total = sum((usage for *_, usage in rows), Usage())
    table.add_row("all", *_cells(sum(number for _, number, _ in rows), total))
    return table


def _cells(number: int, usage: Usage) -> tuple[str, ...]:
    counts = (number, usage.requests, usage.read, usage.written)
    return *(f"{count:,.0f}" for count in counts), shown_cost(usage.cost)


def shown_cost(cost: float | None) -> str:
    """In the currency of the prices."""
    return NOTHING if cost is None else f"{cost:,.2f}" if cost >= 1 else f"{cost:.3g}"
