"""Runs a sweep and writes its folder: results, table, record of the run and report."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.progress import Progress

from app.evaluation.failures import ServiceLostError
from app.evaluation.illustrate import illustrated
from app.evaluation.ledger import Ledger
from app.evaluation.panda import Panda
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.report.page import write_report
from app.evaluation.results import Evaluation
from app.evaluation.run import PlanRun, Timing, executor_of
from app.evaluation.run_record import SweepRecord
from app.evaluation.server import service
from app.evaluation.sweeps import SWEEPS
from app.evaluation.tables import markdown, sweep_summary
from app.executors import Executor


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
        wants_report: whether to write the report, which takes a while.
    """

    sweep: str
    plan: Plan
    folder: Path
    url: str | None = None
    wants_report: bool = True

    def __call__(self, progress: Progress) -> SweepResult:
        """Run the trials that the folder does not have yet. Ctrl-C ends the session and leaves the folder valid.

        Raises:
            EvaluationError: if the session cannot begin.
            ServiceUnreachableError, ServiceProblemError: if there is no service at `url`.
        """
        with Ledger(self.folder / "results.jsonl") as ledger:
            stopped = ""
            if self.plan.remaining(ledger) or (self.wants_report and not self.report.exists()):
                stopped = self._session(ledger, progress)
            evaluation = evaluation_of(self.plan, ledger)
            self.write_results(evaluation)
            return SweepResult(evaluation, stopped, len(self.plan.remaining(ledger)))

    @property
    def report(self) -> Path:
        """The path of the report."""
        return self.folder / "report" / "index.html"

    def _session(self, ledger: Ledger, progress: Progress) -> str:
        """Run a session. Return why it ended early; empty if it did not."""
        self.report.unlink(missing_ok=True)
        with closing(executor_of(self.plan.world)) as executor:
            record = SweepRecord(self.folder / "run.json", self.sweep, self.plan, executor)
            try:
                evaluation = self._run(ledger, executor, progress, record.timing)
                if self.wants_report:
                    self.write_results(evaluation)  # in case somebody does not wait for the pictures
                    with record.timing.measured("report_s"):
                        has_pictures = isinstance(self.plan.world, Panda)
                        tasks = illustrated(evaluation, executor, progress) if has_pictures else evaluation.tasks
                        write_report(evaluation, self.report.parent, tasks)
            except KeyboardInterrupt:
                return "interrupted"
            except ServiceLostError as error:
                return f"the service does not answer any more: {error}"
            finally:
                record.end(evaluation_of(self.plan, ledger))
        return ""

    def _run(self, ledger: Ledger, executor: Executor, progress: Progress, timing: Timing) -> Evaluation:
        with service(self.url, warm_up=self.plan.asks_default_model) as client:
            return PlanRun(self.plan, ledger, client, executor, progress, self.url is not None, timing)()

    def write_results(self, evaluation: Evaluation) -> None:
        """Write the table of the results so far."""
        shift_m = max(method.shift_m for method in self.plan.methods)
        shifted = f"objects moved by {shift_m:g} m after the answer: as answered, and looking again"
        about = shifted if shift_m else SWEEPS[self.sweep].about
        (self.folder / "table.md").write_text(markdown(evaluation, about), encoding="utf-8")
