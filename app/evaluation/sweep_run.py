"""A sweep with everything that it leaves on disk: results, tables, record of the run and page of failures."""

from contextlib import ExitStack, closing
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
from app.evaluation.run import Run, Timing, executor_of
from app.evaluation.run_record import RunRecord, Session
from app.evaluation.server import service
from app.evaluation.sweeps import SWEEPS
from app.evaluation.tables import markdown, sweep_summary
from app.evaluation.voxposer.ask import Models
from app.executors import Executor
from app.llm.llm_settings import LlmSettings


@dataclass(frozen=True, eq=False)
class SweepResult:
    """What there is when a session ends.

    Attributes:
        stopped: why it ended before everything was run; empty if it did not.
        remaining: trials without an outcome, or with an error.
    """

    evaluation: Evaluation
    stopped: str
    remaining: int

    def summary(self) -> dict[str, Any]:
        """The results as one document, as `--json` prints it."""
        return {**sweep_summary(self.evaluation), "remaining": self.remaining, "stopped": self.stopped}


@dataclass(frozen=True)
class SweepRun:
    """One session of a sweep in a folder of results.

    Attributes:
        url: of a running service; None for one of its own.
        wants_report: whether to write the page of failures, which takes a while.
        llm: the settings of LLMs that methods ask without the service; None: no method does.
    """

    sweep: str
    plan: Plan
    folder: Path
    url: str | None = None
    wants_report: bool = True
    llm: LlmSettings | None = None

    def __call__(self, progress: Progress) -> SweepResult:
        """Run what the folder does not have yet; Ctrl-C ends it, with the folder in order.

        Raises:
            EvaluationError: if it cannot begin.
            ServiceUnreachableError, ServiceProblemError: if the service at `url` is none.
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
        """The page of failures."""
        return self.folder / "report" / "index.html"

    def _session(self, ledger: Ledger, progress: Progress) -> str:
        """Why it stopped; empty if it came to its end."""
        self.report.unlink(missing_ok=True)
        record = RunRecord(self.folder / "run.json", self.sweep, self.plan)
        with closing(executor_of(self.plan.world)) as executor:
            session = Session(self.plan.command, executor.description, executor.workers)
            record.write(session)
            try:
                evaluation = self._run(ledger, executor, progress, session.timing)
                if self.wants_report:
                    self.write_results(evaluation)  # what there is, should the pictures take too long
                    self._write_report(evaluation, executor, progress, session.timing)
            except KeyboardInterrupt:
                return "interrupted"
            except ServiceLostError as error:
                return f"the service does not answer any more: {error}"
            finally:
                session.end()
                record.write(session, evaluation_of(self.plan, ledger))
        return ""

    def _run(self, ledger: Ledger, executor: Executor, progress: Progress, timing: Timing) -> Evaluation:
        with ExitStack() as stack:
            warm_up = self.plan.asks_default_model
            client = stack.enter_context(service(self.url, warm_up=warm_up))
            models = None if self.llm is None else stack.enter_context(Models(self.llm))
            return Run(self.plan, ledger, client, executor, progress, self.url is not None, timing, models)()

    def _write_report(self, evaluation: Evaluation, executor: Executor, progress: Progress, timing: Timing) -> None:
        with timing.measured("report_s"):
            has_pictures = isinstance(self.plan.world, Panda)
            tasks = illustrated(evaluation, executor, progress) if has_pictures else evaluation.tasks
            write_report(evaluation, self.report.parent, tasks)

    def write_results(self, evaluation: Evaluation) -> None:
        """The tables of what there is."""
        shift_m = max(method.shift_m for method in self.plan.methods)
        shifted = f"objects moved by {shift_m:g} m after the answer: as answered, and looking again"
        about = shifted if shift_m else SWEEPS[self.sweep].about
        (self.folder / "table.md").write_text(markdown(evaluation, about), encoding="utf-8")
