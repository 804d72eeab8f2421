"""The ASGI entry: `uvicorn app.asgi:app`."""

from app.bootstrap import build_app
from app.logs import log_as_json
from app.settings import Settings

settings = Settings()
if settings.log_format == "json":
    log_as_json()
app = build_app(settings)
