"""The ASGI entry: `uvicorn app.asgi:app`."""

from app.bootstrap import build_app
from app.settings import Settings

app = build_app(Settings())
