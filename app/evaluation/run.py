"""Runs an evaluation: teaches the tasks, then runs the remaining trials; each outcome is stored as soon as it ends."""

import secrets
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import Method
from app.evaluation.plan import Plan, PlannedTrial
from app.evaluation.results import Crash, Trial
from app.evaluation.teach import (
    FIRST_LABELED_SEED,
    LABELED_SCENES,
    Lesson,
    TeachingError,
    record,
    suffix_of,
    upload,
    variants,
)
from app.evaluation.trials import TrialRunner
from app.evaluation.world import World
from app.executors import Executor, ForeignExecutor, LocalExecutor
from app.sim.outcomes import RecordedDemonstration
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

Item = TypeVar("Item")
TEACHING_THREADS = 2  # one task is uploaded while the next is recorded
SIMULATION = ("app.evaluation.trials",)  # what workers import once for all

_Recorded = tuple[RecordedDemonstration, ...]
Lessons = Mapping[str, Lesson | Exception]  # by suffix of the task's name; or why it could not be taught


@dataclass(frozen=True, eq=False)
class PlanRun:
    """One session of a plan.

    Args:
        shared: whether others use the service as well; task names then contain an id of this session.
    """

    plan: Plan
    ledger: Ledger
    client: RoboPromptClient
    executor: Executor
    progress: Progress
    shared: bool = False
    _session: str = field(default_factory=lambda: secrets.token_hex(3))

    def __call__(self) -> None:
        """Run the remaining trials of the plan.

        Raises:
            KeyboardInterrupt: after the trials under way have ended.
        """
        self.run_trials(self.teach())

    def teach(self) -> dict[str, Lessons]:
        """Record each task's demonstrations once, and upload them for every group of methods with remaining trials."""
        bar = self.progress.add_task("demonstrations", total=self.plan.recorded * len(self.plan.tasks))
        needed: dict[str, set[str]] = {task: {""} for task in self.plan.tasks}
        for planned in self.plan.remaining(self.ledger):
            needed[planned.task].add(suffix_of(planned.method, self.plan.methods))
        lessons: dict[str, Lessons] = {}

        def teach(task: str) -> None:
            lessons[task] = self._teach_task(task, needed[task], lambda: self.progress.advance(bar))

        _in_threads(teach, self.plan.tasks, TEACHING_THREADS)
        return lessons

    def _teach_task(self, task: str, suffixes: set[str], on_done: Callable[[], None]) -> Lessons:
        plan, ways = self.plan, variants(self.plan.methods)
        looks = any(ways[suffix].poses == "vision" for suffix in suffixes)
        recording = partial(record, self.executor, plan.world, task, unseen=plan.seeds)
        try:
            recorded = recording(plan.recorded, images=plan.images or looks, on_done=on_done)
            labeled = recording(LABELED_SCENES, images=True, first_seed=FIRST_LABELED_SEED) if looks else ()
        except Exception as error:
            return dict.fromkeys(suffixes, error)
        return {suffix: self._upload(task, suffix, ways[suffix], recorded, labeled) for suffix in suffixes}

    def _upload(
        self, task: str, suffix: str, method: Method, recorded: _Recorded, labeled: _Recorded
    ) -> Lesson | Exception:
        name = f"{task}{suffix}" + (f".eval-{self._session}" if self.shared else "")
        settings = {
            "yaw_symmetry_deg": dict(self.plan.world.tasks[task]),
            "num_demonstrations": self.plan.demonstrations,
            **self.plan.settings,
            **method.settings,
        }
        try:
            return upload(self.client, name, recorded, method, settings, labeled)
        except (ServiceProblemError, ServiceUnreachableError, TeachingError) as error:
            return error

    def run_trials(self, lessons: Mapping[str, Lessons]) -> None:
        """Run the remaining trials, and store each outcome."""
        remaining = self.plan.remaining(self.ledger)
        runner = TrialRunner(self.client, self.executor, self.plan.world)
        total = sum(1 for _ in self.plan.trials())
        bar = self.progress.add_task("trials", total=total, completed=total - len(remaining))

        def run(planned: PlannedTrial) -> None:
            lesson = lessons[planned.task][suffix_of(planned.method, self.plan.methods)]
            outcome: Trial | Crash
            try:
                if isinstance(lesson, Exception):
                    raise lesson
                outcome = runner.run(planned, lesson)
            except Exception as error:
                outcome = Crash(*planned.key, f"{type(error).__name__}: {error}")
            self.ledger.append(outcome, self.plan.digest(planned.method))
            self.progress.advance(bar)

        _in_threads(run, remaining, self.executor.workers + 2)


def _in_threads(work: Callable[[Item], None], items: Sequence[Item], threads: int) -> None:
    """Work on the items in threads. After Ctrl-C or an error, items that have begun are still finished."""
    with ThreadPoolExecutor(threads) as pool:
        try:
            for future in as_completed([pool.submit(work, item) for item in items]):
                future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def executor_of(world: World) -> Executor:
    """Return workers on this machine, in the environment that the world needs."""
    return LocalExecutor(imports=SIMULATION) if world.python is None else ForeignExecutor(world.python)
