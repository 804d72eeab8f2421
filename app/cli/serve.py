"""`roboprompt serve`: run the service."""

from pathlib import Path
from typing import Annotated

import typer


def serve(
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen on")] = 8000,
    data: Annotated[Path | None, typer.Option(help="folder of the database and images")] = None,
) -> None:
    """Run the service until Ctrl-C. Everything else is set by ROBOPROMPT_ variables, see docs/settings.md."""
    import uvicorn

    from app.bootstrap import build_app
    from app.settings import Settings

    settings = Settings() if data is None else Settings(data=data)
    uvicorn.run(build_app(settings), host=host, port=port, log_level="info", timeout_graceful_shutdown=10)
