"""Record demonstrations with a task's expert and upload them."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future

from app.client.client import RoboPromptClient
from app.client.robot import Observation
from app.evaluation.records import FIRST_TEST_SEED, TaughtEpisode
from app.sim.demonstrate import RecordedDemonstration, record_demonstration
from app.sim.tasks import TASKS

MAX_FAILED_SHARE = 0.5


class ExpertFailedError(Exception):
    """A task's expert fails too often to teach the task."""


def teach(
    client: RoboPromptClient,
    executor: Executor,
    task: str,
    number: int,
    control_frequency_hz: float,
    on_done: Callable[[], None],
) -> tuple[TaughtEpisode, ...]:
    """Set the task up and upload `number` successful demonstrations, in the order of their seeds.

    Args:
        on_done: called after each upload.

    Raises:
        ExpertFailedError: if more than half of the expert's attempts fail.
    """
    client.configure_task(task, yaw_symmetry_deg=dict(TASKS[task].yaw_symmetry_deg), num_demonstrations=number)
    taught = []
    for recorded in _successful(executor, task, number, control_frequency_hz):
        taught.append(TaughtEpisode(recorded, _upload(client, task, recorded)))
        on_done()
    return tuple(taught)


def _successful(
    executor: Executor, task: str, number: int, control_frequency_hz: float
) -> Iterator[RecordedDemonstration]:
    """Demonstrations that solve their scenes; a failed one is replaced by that of a further seed."""
    seeds = iter(range(FIRST_TEST_SEED))
    pending = deque(_submit(executor, task, next(seeds), control_frequency_hz) for _ in range(number))
    failed = 0
    while pending:
        recorded = pending.popleft().result()
        if recorded.succeeded:
            yield recorded
            continue
        failed += 1
        if failed > MAX_FAILED_SHARE * number + 1:
            raise ExpertFailedError(f"the expert of {task} failed {failed} times, last: {recorded.failure}")
        pending.append(_submit(executor, task, next(seeds), control_frequency_hz))


def _submit(executor: Executor, task: str, seed: int, control_frequency_hz: float) -> Future[RecordedDemonstration]:
    return executor.submit(record_demonstration, task, seed, control_frequency_hz)


def _upload(client: RoboPromptClient, task: str, recorded: RecordedDemonstration) -> dict[str, object]:
    scene = recorded.scene
    return client.upload(
        task,
        scene.instruction,
        recorded.trajectory,
        Observation(scene.objects, scene.frames),
        control_frequency_hz=recorded.control_frequency_hz,
        extra={"seed": scene.seed, "simulator": "mujoco"},
    )
