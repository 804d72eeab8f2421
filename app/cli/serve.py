"""`roboprompt serve` runs the service."""

import os
from contextlib import nullcontext
from typing import Annotated

import typer
import uvicorn

from app.bootstrap import build_app, open_store
from app.cli.shared import Data, EnvFile, check_port, errors_printed, settings_of
from app.llm.llama.embedded import shared_by_workers
from app.settings import Settings
from roboprompt_client.http import is_loopback

MAX_HEAD_BYTES = 65_536
MAX_CONNECTIONS = 500  # of a worker; more get 503
GRACE_S = 10  # for requests under way when the service has to stop


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
    settings = settings_of(data, env_file)
    if no_auth or settings.auth == "auto":
        auth = "off" if no_auth else "local" if is_loopback(host) else "on"
        settings = settings.model_copy(update={"auth": auth})
    with errors_printed():  # in a sentence and once, before any worker starts
        open_store(settings).close()
    application = build_app(settings) if workers == 1 else _for_workers(settings)
    with nullcontext() if workers == 1 else shared_by_workers(settings):
        uvicorn.run(
            application,
            host=host,
            port=port,
            workers=workers,
            http="h11",  # its heads are bounded
            h11_max_incomplete_event_size=MAX_HEAD_BYTES,
            limit_concurrency=MAX_CONNECTIONS,
            ws="none",
            server_header=False,
            proxy_headers=bool(settings.trusted_proxies),
            forwarded_allow_ips=list(settings.trusted_proxies),
            timeout_graceful_shutdown=GRACE_S,
            log_level="info",
        )


def _for_workers(settings: Settings) -> str:
    """The import name of the application that each worker builds from the environment."""
    for name in ("data", "auth"):
        os.environ[f"ROBOPROMPT_{name.upper()}"] = str(getattr(settings, name))
    return "app.asgi:app"
