"""`roboprompt serve` runs the service; `roboprompt jobs` re-extracts episodes beside it, on this machine's cores."""

import json
import os
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import typer
import uvicorn

from app.api.bounded_protocol import BoundedProtocol
from app.bootstrap import build_app, open_store
from app.cli.shared import Data, EnvFile, check_port, errors_printed, settings_of
from app.executors import Executor, LocalExecutor
from app.logs import log_as_json
from app.services.task_settings import TaskSettings
from app.services.teach.extract import extract_all_again
from app.services.teach.run_jobs import RunJobs
from app.settings import Settings
from app.store.records import EpisodeRecord, Extraction
from app.store.store import Store

GRACE_S = 10  # for requests under way when the service has to stop
CHUNK = 20  # episodes that a worker extracts in one go, some seconds


def serve(
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[int, typer.Option(callback=check_port, help="port to listen on")] = 8000,
    data: Data = None,
    no_auth: Annotated[bool, typer.Option("--no-auth", help="accept every connection, without API keys")] = False,
    workers: Annotated[int, typer.Option(min=1, help="processes that share the port, the store and the LLM")] = 1,
    env_file: EnvFile = None,
) -> None:
    """Run the service until Ctrl-C.

    Where other machines can connect (--host), API keys are required: `roboprompt keys add`.
    Everything else is set by ROBOPROMPT_ variables, see docs/settings.md; no file is read for them but --env-file.
    """
    given = {"data": data, "host": host, "auth": "off" if no_auth else None}
    settings = settings_of(None, env_file).model_copy(
        update={name: value for name, value in given.items() if value is not None}
    )
    with errors_printed():  # in a sentence and once, before any worker starts
        open_store(settings).close()
    application = build_app(settings) if workers == 1 else _for_workers(settings)
    logging: dict[str, Any] = {"log_level": "info"}
    if settings.log_format == "json":
        log_as_json()
        logging = {"log_config": None, "access_log": False}
    uvicorn.run(
        application,
        host=host,
        port=port,
        workers=workers,
        http=BoundedProtocol,
        limit_concurrency=settings.max_connections,
        ws="none",
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=list(settings.trusted_proxies),
        timeout_graceful_shutdown=GRACE_S,
        **logging,
    )


def _for_workers(settings: Settings) -> str:
    """The import name of the application that each worker builds from the environment."""
    for name in ("data", "host", "auth"):
        os.environ[f"ROBOPROMPT_{name.upper()}"] = str(getattr(settings, name))
    os.environ.setdefault("ROBOPROMPT_EMBEDDED_SHARED_FOLDER", str(settings.data / "llm"))
    return "app.asgi:app"


def jobs(data: Data = None, env_file: EnvFile = None) -> None:
    """Run all queued re-extractions of tasks, then end.

    The database and the images are those of the settings, as for the service, which may keep running: with
    ROBOPROMPT_WORK_AT_JOBS=false it leaves jobs to this command.
    """
    settings = settings_of(data, env_file)
    settings = settings.model_copy(update={"data": settings.data.resolve()})
    with errors_printed(), closing(LocalExecutor(imports=(__name__,))) as executor:
        done = _work(settings, executor)
    print(json.dumps({**done, "where": executor.description}))  # noqa: T201


def _work(settings: Settings, executor: Executor) -> dict[str, float]:
    """Run all jobs; return their number, that of their episodes, and the seconds they took."""
    num_jobs, num_episodes, begun_s = 0, 0, time.perf_counter()

    def extract(records: Sequence[EpisodeRecord], wanted: TaskSettings) -> list[Extraction]:
        """In chunks, each by a worker that opens the store itself."""
        nonlocal num_episodes
        num_episodes += len(records)
        chunks = [records[k : k + CHUNK] for k in range(0, len(records), CHUNK)]
        futures = [executor.submit(_extract_chunk, settings, chunk, wanted) for chunk in chunks]
        return [extraction for future in futures for extraction in future.result()]

    with closing(open_store(settings)) as store:
        worker = RunJobs(store, extract=extract, batch=CHUNK * executor.workers)
        while worker.run_next():
            num_jobs += 1
    return {"jobs": num_jobs, "episodes": num_episodes, "seconds": round(time.perf_counter() - begun_s, 2)}


def _extract_chunk(settings: Settings, records: Sequence[EpisodeRecord], wanted: TaskSettings) -> list[Extraction]:
    """Extract episodes again. Runs in a worker."""
    return extract_all_again(_opened_store(settings), records, wanted)


_stores: dict[Path, Store] = {}  # of a worker, by data folder: settings cannot be hashed


def _opened_store(settings: Settings) -> Store:
    """Return the worker's own store; it ends with its process."""
    if settings.data not in _stores:
        _stores[settings.data] = open_store(settings)
    return _stores[settings.data]
