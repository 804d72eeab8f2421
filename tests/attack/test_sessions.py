"""A browser's session ends when it says so, everywhere; and with its key."""

import time
from datetime import UTC, datetime, timedelta

import httpx
import pytest
from sqlalchemy import update

from app.api.access_rules import COOKIE
from app.services.api_keys import KNOWN_FOR_S, LONGEST, create_key
from app.store import api_keys, tables
from app.store.store import Store
from tests.e2e.processes import killable_server


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("sessions")


@pytest.fixture(scope="module")
def store(data):
    opened = Store.open(data)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def keys(store):
    """Made before the service starts, so that every worker knows them."""
    return [create_key(store, f"person {number}", ["read"]) for number in range(3)]


@pytest.fixture(scope="module")
def url(data, keys):
    with killable_server(data, {"ROBOPROMPT_AUTH": "on"}, "--workers", "2") as (_, address):
        yield address


def log_in(url, key):
    answer = httpx.post(f"{url}/ui/login", data={"key": key})
    assert answer.status_code == 303, answer.text
    return answer.cookies[COOKIE]


def statuses(url, session, times=8):
    """Of several connections, so that every worker is asked."""
    return {httpx.get(f"{url}/tasks", headers={"cookie": f"{COOKIE}={session}"}).status_code for _ in range(times)}


def test_a_copied_cookie_is_worth_nothing_after_the_logout(url, store, keys):
    key = keys[0]
    session, other = log_in(url, key), log_in(url, key)
    assert key not in session
    assert statuses(url, session) == {200}
    cookie = {"cookie": f"{COOKIE}={session}"}
    assert httpx.post(f"{url}/ui/logout", headers=cookie).status_code == 403  # another website's doing, perhaps
    assert statuses(url, session) == {200}
    out = httpx.post(f"{url}/ui/logout", headers={**cookie, "origin": url})
    assert (out.status_code, out.headers["location"]) == (303, "/ui/login")
    assert statuses(url, session) == {401}
    assert statuses(url, other) == {200}  # another browser's
    assert httpx.get(f"{url}/tasks", headers={"x-api-key": key}).status_code == 200
    key_id = key.split("_")[1]
    with store.write() as connection:
        api_keys.revoke(connection, key_id)
    assert statuses(url, other) == {401}  # at once: sessions are read each time


def test_a_session_ends_with_its_key(url, store, keys):
    session = log_in(url, keys[1])
    assert statuses(url, session) == {200}
    with store.write() as connection:
        ending = update(tables.api_keys).where(tables.api_keys.c.id == keys[1].split("_")[1])
        connection.execute(ending.values(expires_at=datetime.now(UTC)))
    time.sleep(KNOWN_FOR_S + 0.2)
    refused = httpx.get(f"{url}/tasks", headers={"cookie": f"{COOKIE}={session}"})
    assert (refused.status_code, "expired at" in refused.json()["detail"]) == (401, True)
    assert httpx.get(f"{url}/ui/login", headers={"cookie": f"{COOKIE}={session}"}).status_code == 200


def test_sessions_are_stored_as_digests_and_end_by_themselves(store):
    key_id = create_key(store, "somebody", ["read"]).split("_")[1]
    now = datetime.now(UTC)
    with store.write() as connection:
        api_keys.begin_session(connection, "a" * 64, key_id, now + LONGEST)
        api_keys.begin_session(connection, "b" * 64, key_id, now - timedelta(seconds=1))
        assert api_keys.key_of_session(connection, "a" * 64) == key_id
        assert api_keys.key_of_session(connection, "b" * 64) is None


def test_the_number_of_sessions_of_a_key_is_limited(store):
    key_id = create_key(store, "many", ["read"]).split("_")[1]
    with store.write() as connection:
        digests = [f"{number:064}" for number in range(api_keys.MAX_SESSIONS + 3)]
        for digest in digests:
            api_keys.begin_session(connection, digest, key_id, datetime.now(UTC) + LONGEST)
        alive = [digest for digest in digests if api_keys.key_of_session(connection, digest)]
    assert alive == digests[3:]


def test_no_token_is_on_the_disk(url, keys, data):
    session = log_in(url, keys[2])
    everything = b"".join(path.read_bytes() for path in data.rglob("*") if path.is_file())
    assert session.split("_", 2)[2].encode() not in everything
