import io
from dataclasses import replace

import pytest
from rich.console import Console

from app.evaluation.methods import SWEEPS, Method
from app.evaluation.results import Crash, Evaluation, TaskEvaluation
from app.evaluation.tables import markdown, results_table, sweep_summary
from tests.evaluation.trials import ANSWER, trial

OURS, OTHER = Method("default"), Method("noisy", noise=1.5)


def evaluation(*tasks, methods=(OURS, OTHER)):
    return Evaluation("roboprompt eval --sweep main", methods, tasks)


def task(name, ours, other, crashes=0):
    """A task with (successes, trials) of both methods, and crashes of the first."""
    trials = [
        trial(name, 100_000 + k, method.label, k < successes, ANSWER if method is OURS else None)
        for method, (successes, number) in ((OURS, ours), (OTHER, other))
        for k in range(number)
    ]
    broken = [Crash(name, 100_100 + k, OURS.label, "Traceback ...\nMemoryError: too much") for k in range(crashes)]
    return TaskEvaluation(name, tuple(trials), tuple(broken))


@pytest.fixture
def mixed():
    return evaluation(task("open_drawer", (20, 25), (1, 2)), task("stack_cube", (1, 2), (0, 0), crashes=3))


def rows(text):
    return {row.split(" | ")[0].lstrip("| "): [cell.strip(" |") for cell in row.split(" | ")][1:] for row in text}


def test_table_has_rates_intervals_errors_and_the_paper(mixed):
    lines = rows(line for line in markdown(mixed, "one thing").splitlines() if line.startswith("| "))
    assert lines["open_drawer"] == ["20/25 (61-91 %)", "1/2 (9-91 %)", "72", "0", "32", "74", "93"]
    assert lines["stack_cube"] == ["1/2 (9-91 %), 3 errors", "\N{EN DASH}", "90", "80", "60"] + ["\N{EN DASH}"] * 2
    # a mean over tasks, not over trials; errors and tasks without trials stay out of it
    assert lines["mean"] == ["65.0 %", "50.0 %", "81.0", "40.0", "46.0", "74.0", "93.0"]
    assert lines["default"][:2] == ["embedded/gemma-3-270m, object_frame, paper", "21/27 (59-89 %), 3 errors"]
    assert lines["noisy"][:2] == ["pose noise 1.5", "1/2 (9-91 %)"]


def test_table_says_what_is_compared(mixed):
    text = markdown(mixed, "one thing against another")
    assert text.startswith("# One thing against another\n")
    for said in ("not RLBench itself", "GPT-4 Turbo", "Table I,", "Table II,", "`roboprompt eval --sweep main`"):
        assert said in text
    assert "## Errors\n\n- 3 x MemoryError: too much\n" in text
    assert "Errors\n" not in markdown(evaluation(task("stack_cube", (1, 2), (0, 0))), "one thing")


def crashed(*messages):
    return tuple(Crash("stack_cube", 100_200 + k, OURS.label, message) for k, message in enumerate(messages))


def test_errors_count_as_no_failures():
    ran = task("stack_cube", (1, 2), (2, 2))
    run = evaluation(replace(ran, crashes=crashed("too slow", "out of memory")))
    assert "1/2 (9-91 %), 2 errors" in markdown(run, "one thing")
    figures = sweep_summary(run)["tasks"]["stack_cube"]
    assert (figures["trials"], figures["errors"]) == (2, 2)


def printed(table, width):
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue()


@pytest.mark.parametrize("sweep", ["main", "noise"])
def test_tables_read_well_in_80_columns_without_a_terminal(sweep):
    methods = SWEEPS[sweep].with_models(())
    names = ("push_multiple_buttons", "put_in_cupboard")
    trials = {
        n: tuple(trial(n, 100_000 + k, m.label, k < 2, ANSWER) for m in methods for k in range(25)) for n in names
    }
    run = evaluation(*(TaskEvaluation(name, of) for name, of in trials.items()), methods=methods)
    text = printed(results_table(run), 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    assert "\x1b" not in text
    for name in names:
        assert name in text
    assert text.count("2/25") == len(names) * len(methods)


def test_summary(mixed):
    summary = sweep_summary(mixed)
    assert (summary["trials"], summary["errors"]) == (29, 3)
    assert summary["mean_success_rate"] == {"default": pytest.approx(0.65), "noisy": pytest.approx(0.5)}
    assert summary["paper_mean_percent"]["RoboPrompt"] == 81
    figures = summary["tasks"]["stack_cube"]["methods"]["default"]
    assert (figures["successes"], figures["trials"], figures["errors"]) == (1, 2, 3)
    assert figures["tokens"] == {"prompt_tokens": 100, "cached_tokens": 90, "completion_tokens": 20}


def test_a_task_has_the_first_methods_figures_and_beside_them_everybodys(mixed):
    drawer, cube = (sweep_summary(mixed)["tasks"][name] for name in ("open_drawer", "stack_cube"))
    assert (drawer["successes"], drawer["trials"], drawer["success_rate"]) == (20, 25, pytest.approx(0.8))
    assert (drawer["method"], list(drawer["methods"])) == ("default", ["default", "noisy"])
    assert drawer["methods"]["noisy"]["success_rate"] == 0.5
    assert (cube["methods"]["noisy"]["trials"], cube["methods"]["noisy"]["success_rate"]) == (0, 0.0)
