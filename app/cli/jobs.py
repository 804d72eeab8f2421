"""`roboprompt jobs`: work at re-extractions beside the service, on this machine's cores."""

import json
import time
from collections.abc import Sequence
from contextlib import closing
from functools import cache
from pathlib import Path

from app.bootstrap import open_store
from app.cli.shared import Data, EnvFile, refusals_said, settings_of
from app.executors import Executor, LocalExecutor
from app.services.task_settings import TaskSettings
from app.services.teach.configure import RunJobs
from app.services.teach.extract import extract_all_again
from app.settings import Settings
from app.store.records import EpisodeRecord, Extraction
from app.store.store import Store

CHUNK = 20  # episodes that a worker extracts in one go, some seconds
IMPORTS = ("app.cli.jobs",)  # what a worker needs


def jobs(
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Work at all queued re-extractions of tasks, and end when none is left.

    The database and the images are those of the settings, as for the service, which may keep running: with
    ROBOPROMPT_WORK_AT_JOBS=false it leaves jobs to this command.
    """
    settings = settings_of(data, env_file)
    settings = settings.model_copy(update={"data": settings.data.resolve()})
    with refusals_said(), closing(LocalExecutor(imports=IMPORTS)) as executor:
        done = _work(settings, executor)
    print(json.dumps({**done, "where": executor.description}))  # noqa: T201


def _work(settings: Settings, executor: Executor) -> dict[str, float]:
    """Jobs and episodes worked at, and the seconds it took."""
    num_jobs, num_episodes, begun_s = 0, 0, time.perf_counter()
    address = (str(settings.data), settings.database_url, settings.blobs_url)

    def extract(records: Sequence[EpisodeRecord], wanted: TaskSettings) -> list[Extraction]:
        """In chunks, each by a worker that opens the store itself."""
        nonlocal num_episodes
        num_episodes += len(records)
        chunks = [records[k : k + CHUNK] for k in range(0, len(records), CHUNK)]
        futures = [executor.submit(_extract_chunk, address, chunk, wanted) for chunk in chunks]
        extractions: list[Extraction] = []
        for future in futures:
            extractions += future.result()
        return extractions

    with closing(open_store(settings)) as store:
        worker = RunJobs(store, extract=extract, batch=CHUNK * executor.workers)
        while worker.run_next():
            num_jobs += 1
    return {"jobs": num_jobs, "episodes": num_episodes, "seconds": round(time.perf_counter() - begun_s, 2)}


def _extract_chunk(
    address: tuple[str, str | None, str | None], records: Sequence[EpisodeRecord], wanted: TaskSettings
) -> list[Extraction]:
    """In a worker."""
    return extract_all_again(_opened(*address), records, wanted)


@cache
def _opened(data: str, database_url: str | None, blobs_url: str | None) -> Store:
    """The worker's own; it ends with its process."""
    return open_store(Settings(data=Path(data), database_url=database_url, blobs_url=blobs_url))
