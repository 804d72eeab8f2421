from dataclasses import replace

import pytest

from app.evaluation.paper_sweep import paper_markdown
from app.evaluation.paper_tables import limited, paper_plan, paper_tables
from app.evaluation.results import Crash, Evaluation, TaskEvaluation
from tests.evaluation.trials import ANSWER, trial

TABLES = paper_tables(["openai/gpt-4-turbo"])


def plan_of(tables):
    return paper_plan(tables, 10, "roboprompt eval --sweep paper", 1, 100_000)


def trials_by_table(tables):
    counted = {table.name: 0 for table in tables}
    for table, _ in plan_of(tables).trials_by_table():
        counted[table.name] += 1
    return counted


def test_shared_trials_are_run_once():
    tasks, scenes, real = 16, 25, 10
    assert trials_by_table(TABLES) == {
        "I": 2 * tasks * scenes,
        "II": 2 * 6 * real,
        "III": 0,
        "IV": 0,
        "3a": 5 * tasks * scenes,
        "3b": 4 * tasks * scenes,
        "3c": 4 * 2 * real,
        "4a": tasks * scenes,
        "4b": tasks * scenes,
        "4c": 2 * tasks * scenes,
    }
    several = paper_tables(["openai/gpt-4-turbo", "openai/gpt-4o"])
    assert trials_by_table(several)["III"] == tasks * scenes


def test_cells_come_table_by_table_and_none_twice():
    cells = [(cell.task, cell.seed, cell.method.label) for cell in plan_of(TABLES).trials()]
    assert len(set(cells)) == len(cells) == sum(trials_by_table(TABLES).values())
    assert {label for _, _, label in cells[:800]} == {"KAT", "RoboPrompt"}


def test_a_result_holds_whichever_tables_are_run():
    """What was paid for one table is not paid for again with another."""
    ours = next(method for method in TABLES[0].methods if method.label == "RoboPrompt")
    digests = {plan_of([table]).digest(ours) for table in TABLES}
    assert digests == {plan_of(TABLES).digest(ours)}


def test_no_two_methods_share_a_label():
    by_label = {}
    for method in (method for table in TABLES for method in table.methods):
        assert by_label.setdefault(method.label, method) == method


def test_every_method_names_its_model():
    assert all(method.options["model"] == "openai/gpt-4-turbo" for table in TABLES for method in table.methods)
    assert not plan_of(TABLES).asks_default_model


def test_some_tasks_and_scenes():
    few = limited(TABLES, ["destack_cube"], 3)
    assert [table.name for table in few] == ["II", "IV", "3c"]
    assert {table.episodes for table in few} == {3}
    assert [table.tasks for table in few] == [("destack_cube",)] * 3
    assert limited(TABLES, None, None) == TABLES


@pytest.fixture
def shown():
    """Table I with the results of two tasks: 20 of 25, and 1 of 2 with an error beside."""
    drawer = [trial("open_drawer", 100_000 + k, "RoboPrompt", k < 20, answer()) for k in range(25)]
    jar = [trial("close_jar", 100_000 + k, "RoboPrompt", k < 1, answer()) for k in range(2)]
    crash = Crash("close_jar", 100_002, "RoboPrompt", "OSError: no wire")
    tasks = {name: TaskEvaluation(name, (), ()) for name in TABLES[0].tasks}
    tasks["open_drawer"] = replace(tasks["open_drawer"], trials=tuple(drawer))
    tasks["close_jar"] = replace(tasks["close_jar"], trials=tuple(jar), crashes=(crash,))
    plan = plan_of([TABLES[0], TABLES[2]])
    return paper_markdown(plan, Evaluation(plan.command, plan.methods, tuple(tasks.values()), 0.0), {})


def answer():
    return {**ANSWER, "model": "openai/gpt-4-turbo"}


def rows(text):
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ") and "---" not in line]
    return [(label, cells) for label, *cells in lines]


def test_the_papers_layout(shown):
    above, below = (cells for label, cells in rows(shown) if label == "RoboPrompt, paper")
    assert above == ["100", "80", "100", "72", "100", "84", "100", "52"]
    assert below == ["40", "20", "16", "16", "24", "16", "8", "0", "51.8"]
    labels = [label for label, _ in rows(shown)]
    first = labels.index("RVT-2, paper")
    assert labels[first : first + 7] == [
        "RVT-2, paper",
        "Act3D, paper",
        "VoxPoser, paper",
        "KAT, paper",
        "KAT, here (openai/gpt-4-turbo)",
        "RoboPrompt, paper",
        "RoboPrompt, here (openai/gpt-4-turbo)",
    ]


def test_ours_says_what_is_missing(shown):
    above, below = (cells for label, cells in rows(shown) if label == "RoboPrompt, here (openai/gpt-4-turbo)")
    none = "\N{EN DASH}"
    assert above == ["50 (1/2, 1 error)", none, none, "80", none, none, none, none]
    assert below == [none] * 8 + ["65.0 (2 of 16 tasks)"]
    assert dict(rows(shown))["openai/gpt-4-turbo, here"] == ["65.0 (2 of 16 tasks)"]
    assert dict(rows(shown))["GPT-4o, paper"] == ["56.3"]
    assert "VoxPoser is not run here" in shown
    assert "- 1 x OSError: no wire" in shown


def test_tokens_are_counted_once(shown):
    assert dict(rows(shown))["all"] == ["27", "2,700", "540", "\N{EN DASH}"]
