"""Lets people see predictions that take long, from whichever process they look."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from uuid import uuid4

import anyio.to_thread

from app.services.question import Question
from app.store.errors import StoreUnavailableError
from app.store.under_way import UnderWay, UnderWayNotes

SHOWN_AFTER_S = 0.5  # shorter ones are never written down
GRACE_S = 5.0  # a note that a killed process leaves behind outlives its request's deadline by no more
logger = logging.getLogger(__name__)
_showing: set[asyncio.Task[None]] = set()  # the event loop itself holds its tasks weakly


@asynccontextmanager
async def watched(notes: UnderWayNotes, question: Question) -> AsyncIterator[None]:
    """Let the prediction be seen while the body runs, if it runs for long. The body waits for nothing of this."""
    request, now_s = question.request, time.time()
    deadline_s = now_s + request.timeout_s + GRACE_S
    note = UnderWay(uuid4().hex, request.task, request.instruction, question.profile.name, now_s, deadline_s)
    ended = asyncio.Event()

    def show() -> None:
        showing = asyncio.create_task(_show(notes, note, ended))
        _showing.add(showing)
        showing.add_done_callback(_showing.discard)

    timer = asyncio.get_running_loop().call_later(SHOWN_AFTER_S, show)
    try:
        yield
    finally:
        timer.cancel()
        ended.set()


async def _show(notes: UnderWayNotes, note: UnderWay, ended: asyncio.Event) -> None:
    try:
        await anyio.to_thread.run_sync(notes.begin, note)
    except StoreUnavailableError as error:
        logger.warning("%s", error)  # nobody sees it, but it goes on
    await ended.wait()
    await anyio.to_thread.run_sync(notes.end, note.id)
