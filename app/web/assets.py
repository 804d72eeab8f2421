"""What browsers keep: our own style sheet and scripts, and plotly.js from its installed package."""

import hashlib
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

FOLDER = Path(__file__).parent / "static"
FOREVER = "public, max-age=31536000, immutable"  # an address changes with its content
PLOTLY_ADDRESS = f"/ui/vendor/plotly-{version('plotly')}.min.js"


def _digest() -> str:
    """Equal for equal files: part of their addresses, so that scripts that import each other stay of one version."""
    digest = hashlib.sha256()
    for path in sorted(FOLDER.iterdir()):
        digest.update(f"\0{path.name}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


STATIC_ADDRESS = f"/ui/static/{_digest()}"


class _Immutable(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = FOREVER
        return response


def serve_assets(app: FastAPI) -> None:
    """Let `app` serve them under `/ui`."""
    app.mount(STATIC_ADDRESS, _Immutable(directory=FOLDER), name="ui-static")
    plotly = str(files("plotly") / "package_data" / "plotly.min.js")

    def serve_plotly() -> Response:
        return FileResponse(plotly, media_type="text/javascript", headers={"Cache-Control": FOREVER})

    app.add_api_route(PLOTLY_ADDRESS, serve_plotly, include_in_schema=False)
