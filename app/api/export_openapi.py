"""Write the OpenAPI document: `python -m app.api.export_openapi > openapi/openapi.json`."""

import contextlib
import json
import sys
from collections.abc import AsyncIterator
from importlib.metadata import version
from typing import NoReturn

from app.api.app import create_app
from app.services.container import Services


@contextlib.asynccontextmanager
async def _no_services() -> AsyncIterator[Services]:
    yield _never()


def _never() -> NoReturn:
    raise RuntimeError("this application only describes itself")


def openapi_text() -> str:
    """The document as it is kept in the repository."""
    document = create_app(_no_services, version("roboprompt")).openapi()
    return json.dumps(document, indent=2, sort_keys=True) + "\n"


if __name__ == "__main__":
    sys.stdout.write(openapi_text())
