"""`roboprompt eval --sweep paper` against a server that speaks OpenAI's HTTP API on loopback."""

import io
import json
import re
from contextlib import nullcontext

import pytest
from rich.console import Console
from rich.progress import Progress
from typer.testing import CliRunner

from app.cli import application
from app.cli.evaluate_options import EvaluateOptions
from app.cli.evaluate_plan import paper_of
from app.evaluation import paper_tables
from app.evaluation.failures import NotConfirmedError
from app.evaluation.ledger import Ledger
from app.evaluation.run import Run
from tests.evaluation.copying_llm import copying_llm
from tests.evaluation.test_run import InlineExecutor

MODEL = "openai/gpt-4-turbo"
PRICES = ["--price-in", "10", "--price-out", "30"]
BUDGET = 0.022  # enough for two trials or three
NUM_TRIALS = 4  # two scenes of one task, for KAT and RoboPrompt
KEY = "sk-of-this-test"
# --yes, whether there is a terminal, what is typed there, whether the LLM is asked
AGREEMENTS = [
    (False, False, "y\n", False),
    (False, True, "n\n", False),
    (False, True, "\n", False),
    (False, True, "y\n", True),
    (True, False, "", True),
]


def evaluate(*words):
    few = ["--table", "I", "--table", "III", "--task", "push_button", "--episodes", "2", "--demos", "2"]
    return CliRunner().invoke(application, ["eval", "--sweep", "paper", "--model", MODEL, *few, "--no-report", *words])


def said(run):
    return " ".join(run.output.replace("\N{BOX DRAWINGS LIGHT VERTICAL}", " ").split())


def outcomes(folder):
    path = folder / "results.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return {(line["method"], line["seed"]): line["status"] for line in lines}


def spent(folder):
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()]
    usages = [line["answer"]["usage"] for line in lines]
    return sum(10 * usage["prompt_tokens"] + 30 * usage["completion_tokens"] for usage in usages) / 1_000_000


@pytest.fixture(scope="module")
def environment():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_tables, "STORED", 2)  # to record fewer demonstrations
        patch.setenv("ROBOPROMPT_OPENAI_API_KEY", KEY)
        patch.delenv("ROBOPROMPT_RECORD_LLM", raising=False)
        patch.delenv("ROBOPROMPT_REPLAY_LLM", raising=False)
        yield patch


@pytest.fixture(scope="module")
def asked(environment):
    """What the provider was asked so far."""
    with copying_llm() as (url, asked):
        environment.setenv("ROBOPROMPT_OPENAI_BASE_URL", url)
        yield asked


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("paper") / "results"


def row(text, name):
    return next(line.split() for line in text.splitlines() if line.split()[:1] == [name])


def test_a_budget_stops_it(asked, folder):
    run = evaluate("--out", str(folder), *PRICES, "--yes", "--json", "--budget", str(BUDGET))
    assert run.exit_code == 3, run.output
    first, third, total = (row(run.output, name) for name in ("I", "III", "all"))
    assert first[1:] == total[1:]
    assert first[1:3] == ["4", "4"]
    assert third[1:] == ["0", "0", "0", "0", "\N{EN DASH}"]
    read, written, cost = (float(cell.replace(",", "")) for cell in total[3:])
    assert cost == pytest.approx((10 * read + 30 * written) / 1_000_000, rel=0.02)
    done = len(outcomes(folder))
    assert len(asked) == done
    assert done in (2, 3)
    assert spent(folder) <= BUDGET
    summary = json.loads(run.stdout.splitlines()[-1])
    assert summary["remaining"] == NUM_TRIALS - done
    assert re.match(
        r"budget: the next trial may cost [\d.]+; of the budget of 0\.022, [\d.]+ is spent", summary["stopped"]
    )
    assert f"{NUM_TRIALS - done} trials remain; go on with" in said(run)


@pytest.mark.parametrize(("yes", "there", "answer", "goes_on"), AGREEMENTS)
def test_who_agrees_to_the_estimate(yes, there, answer, goes_on, monkeypatch, tmp_path):
    """Only --yes and a person at a terminal do; nothing is asked before."""
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    monkeypatch.setattr("sys.stdin.isatty", lambda: there)
    out = io.StringIO()
    options = EvaluateOptions(sweep="paper", model=[MODEL], yes=yes, out=tmp_path)
    sweep = paper_of(options, Console(file=out, width=80), Progress(disable=True))
    began = []
    monkeypatch.setattr("app.evaluation.run.in_threads", lambda *_: began.append(True))
    monkeypatch.setattr("app.evaluation.run.estimates", lambda *_: {})
    with Ledger(tmp_path / "results.jsonl") as ledger:
        purse = sweep.purse(ledger)
        run = Run(sweep.plan, ledger, None, InlineExecutor(), Progress(disable=True), purse=purse)
        with nullcontext() if goes_on else pytest.raises(NotConfirmedError, match="no LLM was asked"):
            run.run_trials({})
    assert bool(began) == goes_on
    assert "estimate, before anything is asked" in out.getvalue()


def test_the_same_command_goes_on(asked, folder):
    run = evaluate("--out", str(folder), *PRICES, "--yes", "--json", "--budget", str(BUDGET))
    assert run.exit_code == 0, run.output
    assert len(asked) == len(outcomes(folder)) == NUM_TRIALS
    assert json.loads(run.stdout.splitlines()[-1])["remaining"] == 0
    text = (folder / "table.md").read_text()
    assert "| RVT-2, paper | 100 |" in text
    assert spent(folder) > BUDGET
    assert re.search(rf"\| all \| {NUM_TRIALS} \| [\d,]+ \| [\d,]+ \| {spent(folder):.3g} \|", text)
    assert f"| RoboPrompt, here ({MODEL}) | " in text
    assert f"| {MODEL}, here | " in text
    assert "error" not in text.split("## Tokens")[0].replace("errors are trials", "")


def test_what_is_there_costs_nothing_again(asked, folder):
    run = evaluate("--out", str(folder), *PRICES)
    assert run.exit_code == 0, run.output
    assert len(asked) == NUM_TRIALS
    assert (folder / "table.md").read_text().splitlines()[0] in run.output


def test_the_paper_is_asked_as_it_asks(asked):
    system = {next(m["content"] for m in body["messages"] if m["role"] == "system")[:40] for _, body in asked}
    assert "You are a Franka Panda robot with a para" in system
    assert {body["model"] for _, body in asked} == {"gpt-4-turbo"}
    assert {key for key, _ in asked} == {f"Bearer {KEY}"}


def test_recorded_traffic_makes_the_tables_again_without_a_key(asked, folder, environment, tmp_path):
    recorded = folder / "llm"
    assert not any(KEY in path.read_text() for path in recorded.iterdir())
    environment.delenv("ROBOPROMPT_OPENAI_API_KEY")
    environment.setenv("ROBOPROMPT_REPLAY_LLM", str(recorded))
    run = evaluate("--out", str(tmp_path), *PRICES, "--yes")
    assert run.exit_code == 0, run.output
    assert len(asked) == NUM_TRIALS
    assert outcomes(tmp_path) == outcomes(folder)
    before, again = ((place / "table.md").read_text().split("Command:")[0] for place in (folder, tmp_path))
    assert again == before


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--sweep", "paper"], "--model: is missing: --sweep paper asks a model by its name"),
        (["--sweep", "paper", "--model", "nearest", "--table", "VII"], "'VII' is none of I, II, III, IV, 3a"),
        (["--sweep", "paper", "--model", "nearest", "--budget", "1"], "say --price-in and --price-out"),
        (["--sweep", "paper", "--model", "nearest", *PRICES, "--budget", "0"], "is 0 (valid: a finite amount above 0)"),
        (["--sweep", "paper", "--model", "nearest", *PRICES, "--budget", "nan"], "a finite amount above 0"),
        (["--sweep", "paper", "--model", "nearest", "--price-in", "1"], "both or none"),
        (["--sweep", "paper", "--model", "nearest", "--price-in", "-1"], "or equal to 0"),
        (["--sweep", "paper", "--model", "nearest", "--price-in", "inf", "--price-out", "1"], "a finite number"),
        (["--sweep", "paper", "--model", "nearest", "--method", "KAT"], "whose tables settle it"),
        (["--sweep", "paper", "--model", "nearest", "--url", "http://127.0.0.1:1"], "its own service records"),
        (["--sweep", "paper", "--model", "nearest", "--table", "II", "--task", "turn_tap"], "none of the tables II"),
        (["--sweep", "main", "--budget", "1"], "is for --sweep paper alone"),
        (["--table", "I"], "is for --sweep paper alone"),
        (["--yes"], "is for --sweep paper alone"),
    ],
)
def test_options_that_do_not_go_together(words, expected):
    run = CliRunner().invoke(application, ["eval", *words])
    assert run.exit_code == 2, run.output
    assert expected in said(run)
