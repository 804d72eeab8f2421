"""The ASGI entry: `uvicorn app.asgi:app`."""

import gc

from app.bootstrap import build_app
from app.logs import log_as_json
from app.settings import Settings

settings = Settings()
if settings.log_format == "json":
    log_as_json()
app = build_app(settings)
# All that was imported and built up to here stays, so that no collection of garbage need look at it again.
gc.collect()
gc.freeze()
