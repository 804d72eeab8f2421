"""What the service remembers: tasks, episodes, predictions (SQLAlchemy) and images (content-addressed files).

Synchronous, without web types: call it in a thread (`anyio.to_thread`). `errors.StoreError` draws what it raises.
"""

from app.store.store import Store

__all__ = ["Store"]
