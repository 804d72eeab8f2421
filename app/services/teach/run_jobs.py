"""Jobs that extract a task's episodes again in batches, and switch over at the end."""

import logging
import threading
from collections.abc import Callable, Sequence
from datetime import timedelta
from functools import partial

from pydantic import ValidationError

from app.services.task_settings import TaskSettings
from app.services.teach.configure import with_workspace
from app.services.teach.extract import extract_all_again
from app.store import episodes, jobs, tasks
from app.store.errors import CorruptDataError, NotFoundError
from app.store.records import EpisodeRecord, Extraction, JobRecord
from app.store.store import Store
from app.store.visibility import Visibility, seeing
from roboprompt_client.errors import InvalidInputError, RoboPromptError

ExtractBatch = Callable[[Sequence[EpisodeRecord], TaskSettings], list[Extraction]]
BATCH = 20  # episodes that a job extracts between two renewals of its claim
# A batch takes seconds, a pose server's perhaps a minute. After a crash the next process waits for it.
LEASE = timedelta(seconds=60)
logger = logging.getLogger(__name__)


class RunJobs:
    """Runs one job after the other. Synchronous: call it in a thread.

    Args:
        lease: how long a claim holds unless it is renewed.
        on_done: called with the task of each job that succeeded.
        extract: extracts a batch of episodes again, perhaps elsewhere; None: here, one after the other.
        batch: episodes between two renewals of the claim.
    """

    def __init__(
        self,
        store: Store,
        lease: timedelta = LEASE,
        on_done: Callable[[str], None] = lambda task: None,
        extract: ExtractBatch | None = None,
        batch: int | None = None,
    ) -> None:
        self._store = store
        self._lease = lease
        self._on_done = on_done
        self._extract = extract or partial(extract_all_again, store)
        self._batch = batch or BATCH
        self._stopping = threading.Event()

    def stop(self) -> None:
        """Let `run_next` return after the batch that it is at; the job goes on in another process or later."""
        self._stopping.set()

    @property
    def stopping(self) -> bool:
        return self._stopping.is_set()

    def wait(self, seconds: float) -> None:
        """Sleep, but not beyond `stop`."""
        self._stopping.wait(seconds)

    def run_next(self) -> bool:
        """Claim the next job, also one that a dead process left, and finish it; return whether there was one.

        Raises:
            StoreError: if the store fails; the job is taken up again when its claim has run out.
        """
        with self._store.write() as connection:
            job = jobs.claim(connection, self._lease)
        if job is None:
            return False
        try:
            self._run(job)
        except (jobs.LostClaimError, NotFoundError):
            logger.warning("job %s was taken over, or its task deleted", job.id)
        return True

    def _run(self, job: JobRecord) -> None:
        logger.info("job %s extracts the episodes of %r again", job.id, job.task)
        try:
            while not self._stopping.is_set():
                if not self._extract_batch(job) and self._finish(job):
                    return
        except (InvalidInputError, CorruptDataError) as error:
            self._fail(job, str(error))
            return
        except (jobs.LostClaimError, RoboPromptError, MemoryError):
            raise
        except Exception:  # a retry would meet it again
            logger.exception("job %s", job.id)
            self._fail(job, "an unexpected error; the service's log has the details")
            return
        with self._store.write() as connection:
            jobs.release(connection, job)

    def _fail(self, job: JobRecord, error: str) -> None:
        with self._store.write() as connection:
            jobs.fail(connection, job, error)

    def _settings(self, job: JobRecord, current: dict[str, object]) -> TaskSettings:
        """Return the settings as they will be: what else has been set meanwhile stays.

        Raises:
            InvalidInputError: if that and the job's changes do not go together.
        """
        try:
            return TaskSettings.model_validate(current).changed(job.changes)
        except ValidationError as error:
            first = error.errors()[0]
            raise InvalidInputError(".".join(map(str, first["loc"])), f"contradicts the job: {first['msg']}") from error

    def _extract_batch(self, job: JobRecord) -> bool:
        """Whether there was anything left to extract."""
        with self._store.read() as connection:
            settings = self._settings(job, tasks.get(connection, job.task).settings)
            batch = jobs.pending(connection, job, self._batch)
        if not batch:
            return False
        extractions = self._extract(batch, settings)
        with self._store.write() as connection:
            jobs.stage(connection, job, extractions, self._lease)
        return True

    def _finish(self, job: JobRecord) -> bool:
        """Switch over, unless an episode came in meanwhile."""
        with self._store.write() as connection:
            task = tasks.lock(connection, job.task)
            if jobs.pending(connection, job, 1):
                return False
            settings = self._settings(job, task.settings)
            jobs.finish(connection, job)
            shown = episodes.demonstrations(connection, job.task) if settings.workspace.preset == "auto" else ()
            after = with_workspace(settings, shown, job.changes).model_dump(mode="json")
            with seeing(Visibility(actor=f"job {job.id}")):
                changed = tasks.update_settings(connection, job.task, after)
            if changed.version == task.version:  # keyframes may differ all the same, and prompts are kept by version
                tasks.change(connection, job.task, {})
        logger.info("job %s is done", job.id)
        self._on_done(job.task)
        return True
