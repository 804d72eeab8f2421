"""A whole run: a service of its own, tasks taught and tried, all methods side by side."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path

from rich.progress import Progress

from app.client.client import RoboPromptClient
from app.evaluation.records import FIRST_TEST_SEED, Evaluation, Method, TaskEvaluation
from app.evaluation.server import running_server
from app.evaluation.teach import teach
from app.evaluation.trials import run_trials


@dataclass(frozen=True)
class Plan:
    """What to run.

    Attributes:
        episodes: unseen scenes a task.
        demonstrations: recorded and uploaded a task.
        command: for the report.
    """

    tasks: tuple[str, ...]
    methods: tuple[Method, ...]
    episodes: int
    demonstrations: int
    control_frequency_hz: float
    command: str


def evaluate(plan: Plan, progress: Progress) -> Evaluation:
    """Run the plan on a service of its own, in a temporary folder.

    Raises:
        ServerStartError, ExpertFailedError, ServiceUnreachableError.
    """
    started = time.perf_counter()
    with _service_and_workers() as (client, executor):
        tasks = tuple(_evaluate_task(plan, task, client, executor, progress) for task in plan.tasks)
        models: Sequence[dict[str, object]] = client.get("/models")["models"]
    return Evaluation(plan.command, plan.methods, tasks, time.perf_counter() - started, tuple(models))


def _evaluate_task(
    plan: Plan, task: str, client: RoboPromptClient, executor: Executor, progress: Progress
) -> TaskEvaluation:
    bar = progress.add_task(f"{task}: demonstrations", total=plan.demonstrations)
    taught = teach(
        client, executor, task, plan.demonstrations, plan.control_frequency_hz, lambda: progress.advance(bar)
    )
    bar = progress.add_task(f"{task}: unseen scenes", total=plan.episodes * len(plan.methods))
    seeds = range(FIRST_TEST_SEED, FIRST_TEST_SEED + plan.episodes)
    trials = run_trials(client, executor, task, seeds, plan.methods, lambda trial: progress.advance(bar))
    return TaskEvaluation(task, taught, trials)


@contextmanager
def _service_and_workers() -> Iterator[tuple[RoboPromptClient, Executor]]:
    # Workers are spawned, not forked: OpenGL contexts and locks do not survive a fork.
    with (
        tempfile.TemporaryDirectory(prefix="roboprompt-") as data,
        running_server(Path(data)) as url,
        RoboPromptClient(url) as client,
        ProcessPoolExecutor(cpu_count(), get_context("spawn")) as executor,
    ):
        yield client, executor
