"""Requests with one prefix share the slots that have read it."""

import asyncio
from collections import OrderedDict, deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

# Reading ten demonstrations takes as long on two cores; another slot that knows them hardly speeds replies up there.
PATIENCE_S = 5.0


class WarmSlots:
    """Lets a request wait for a slot that knows its prefix, rather than read the prefix again in another slot.

    llama.cpp itself picks the idle slot that shares most of a prompt, but of the requests that come at once each gets
    another slot: four robots that begin together would each wait until all four slots have read the same. Who has
    waited for `PATIENCE_S` takes a further slot, so that lasting demand spreads out. Used from one event loop.

    Args:
        slots: of the server; so many prefixes are remembered, the most recently used ones.
    """

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._lanes: OrderedDict[str, _Lane] = OrderedDict()

    @asynccontextmanager
    async def turn(self, prefix: str) -> AsyncIterator[None]:
        """Inside the block one of the slots that know the prefix is this request's.

        Args:
            prefix: its name; requests with an empty one never wait.
        """
        if not prefix:
            yield
            return
        lane = self._lane(prefix)
        await lane.enter(self._slots)
        try:
            yield
        finally:
            lane.leave()

    def _lane(self, prefix: str) -> "_Lane":
        lane = self._lanes.setdefault(prefix, _Lane())
        self._lanes.move_to_end(prefix)
        while len(self._lanes) > self._slots:
            self._lanes.popitem(last=False)
        return lane


class _Lane:
    """The requests of one prefix, first come, first served."""

    def __init__(self) -> None:
        self._known, self._busy = 1, 0  # slots
        self._waiting: deque[asyncio.Future[None]] = deque()

    async def enter(self, slots: int) -> None:
        if self._busy < self._known:
            self._busy += 1
            return
        turn = asyncio.get_running_loop().create_future()
        self._waiting.append(turn)
        try:
            done, _ = await asyncio.wait({turn}, timeout=PATIENCE_S)
            if not done and self._known >= slots:
                await asyncio.wait({turn})
        except asyncio.CancelledError:
            self._give_up(turn)
            raise
        if not turn.done():
            self._waiting.remove(turn)
            self._known += 1
            self._busy += 1

    def leave(self) -> None:
        """Hand the slot to whoever waits longest."""
        if self._waiting:
            self._waiting.popleft().set_result(None)
        else:
            self._busy -= 1

    def _give_up(self, turn: asyncio.Future[None]) -> None:
        if turn.done():
            self.leave()  # its turn came just now
        else:
            self._waiting.remove(turn)
