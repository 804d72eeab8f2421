import asyncio
from datetime import UTC, datetime

import pytest

from app.services.api_keys import KeyRing, create_key, digest_of
from app.store import api_keys
from app.store.api_keys import ApiKeyRecord
from app.store.errors import NotFoundError

from .drafts import write


def test_keys_come_back_as_they_went_in(store):
    record = ApiKeyRecord("k1", "robot 1", "d" * 64, "predict", datetime.now(UTC))
    write(store, api_keys.add, record)
    with store.read() as connection:
        assert api_keys.list_all(connection) == (record,)
        assert api_keys.valid(connection) == (record,)


def test_a_revoked_key_stays_in_the_list_and_is_no_longer_valid(store):
    token = create_key(store, "robot", "read")
    key_id = token.split("_")[1]
    with store.write() as connection:
        api_keys.revoke(connection, key_id)
        (first,) = api_keys.list_all(connection)
        api_keys.revoke(connection, key_id)
        assert api_keys.list_all(connection) == (first,)
        assert api_keys.valid(connection) == ()
        with pytest.raises(NotFoundError, match="there is no API key 'nobody'"):
            api_keys.revoke(connection, "nobody")


def test_every_key_is_another_and_only_its_digest_is_kept(store):
    tokens = {create_key(store, "robot", "admin") for _ in range(20)}
    assert len({token.split("_", 2)[2] for token in tokens}) == 20
    with store.read() as connection:
        assert {record.digest for record in api_keys.list_all(connection)} == set(map(digest_of, tokens))
        assert {record.scope for record in api_keys.list_all(connection)} == {"admin"}


def test_the_ring_reads_the_keys_once_in_a_while(store, monkeypatch):
    monkeypatch.setattr("app.services.api_keys.KNOWN_FOR_S", 0.2)
    token, reads = create_key(store, "robot", "predict"), []

    async def recognize_often():
        ring = KeyRing(store)
        read, ring._read = ring._read, lambda: reads.append(1) or read()  # type: ignore[method-assign, func-returns-value]
        callers = [await ring.recognize(token) for _ in range(50)]
        assert {caller.name for caller in callers if caller} == {"robot"}
        assert callers[0] is not None
        assert callers[0].may("read")
        assert not callers[0].may("teach")
        write(store, api_keys.revoke, token.split("_")[1])
        await asyncio.sleep(0.25)
        assert await ring.recognize(token) is None

    asyncio.run(recognize_often())
    assert len(reads) == 2
