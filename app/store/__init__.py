"""Storage of tasks, episodes, predictions (SQLAlchemy) and images (content-addressed files).

`store.Store` opens both. Synchronous, without web types: call it in a thread (`anyio.to_thread`).
`errors.StoreError` draws what it raises.
"""
