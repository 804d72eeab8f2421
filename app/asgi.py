"""The ASGI entry: `uvicorn app.asgi:app`."""

import gc

from app.bootstrap import build_app
from app.settings import Settings

app = build_app(Settings())
# All that was imported and built up to here stays, so that no collection of garbage need look at it again.
gc.collect()
gc.freeze()
