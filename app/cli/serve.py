"""`roboprompt serve`: run the service."""

from pathlib import Path
from typing import Annotated

import typer


def serve(
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen on")] = 8000,
    data: Annotated[Path | None, typer.Option(help="folder of the database and images")] = None,
    no_auth: Annotated[bool, typer.Option("--no-auth", help="let in whoever can connect, without API keys")] = False,
) -> None:
    """Run the service until Ctrl-C.

    Where others than this machine can connect (--host), API keys are required: `roboprompt keys create`.
    Everything else is set by ROBOPROMPT_ variables, see docs/settings.md.
    """
    import uvicorn

    from app.bootstrap import build_app
    from app.settings import Settings

    given = {"data": data, "auth": "off" if no_auth else None}
    settings = Settings().model_copy(update={name: value for name, value in given.items() if value is not None})
    uvicorn.run(build_app(settings, host), host=host, port=port, log_level="info", timeout_graceful_shutdown=10)
