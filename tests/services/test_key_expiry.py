"""Keys that end on their own."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from app.services.api_keys import ExpiredKeyError, KeyRing, create_key

LIFE = timedelta(seconds=2)


def test_a_key_is_accepted_until_it_expires(store):
    lasting = create_key(store, "lasting", ["read"], None, None)
    brief = create_key(store, "brief", ["read"], None, datetime.now(UTC) + LIFE)

    async def ask():
        ring = KeyRing(store)
        before = [await ring.recognize(token) for token in (lasting, brief)]
        await asyncio.sleep(LIFE.total_seconds())
        with pytest.raises(ExpiredKeyError, match="'brief' expired at"):
            await ring.recognize(brief)
        after = await ring.recognize(lasting)
        await ring.aclose()
        return [caller.name for caller in (*before, after)]

    assert asyncio.run(ask()) == ["lasting", "brief", "lasting"]
