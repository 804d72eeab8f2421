"""What belongs to which key: in a database from before keys owned anything, and for each query."""

import asyncio
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from alembic import command
from sqlalchemy import text

from app.services.api_keys import KeyRing, caller_from, digest_of
from app.store import api_keys, idempotency, predictions
from app.store.api_keys import ApiKeyRecord
from app.store.database import Database
from app.store.errors import ForbiddenTaskError, NotFoundError
from app.store.migration import alembic_config, migration_transaction
from app.store.records import StoredResponse
from app.store.store import Store
from app.store.visibility import Visibility, seeing

from .drafts import TASK, predict, prediction_draft

TOKEN = "rp_0123456789ab_of_before"
BEFORE = (
    "INSERT INTO tasks (name, version, settings, created_at, updated_at) "
    f"VALUES ('{TASK}', 1, '{{}}', '2026-01-01', '2026-01-01')",
    "INSERT INTO api_keys (id, name, digest, scopes, created_at) "
    f"VALUES ('0123456789ab', 'robot', '{digest_of(TOKEN)}', '[\"predict\"]', '2026-01-01')",
    "INSERT INTO predictions (id, task, instruction, model, representation, prompt_format, status, created_at, "
    "request, demonstration_ids, prompt_system, prompt_user, usage, timings_ms) VALUES ("
    f"'old', '{TASK}', 'pick', 'nearest', 'absolute', 'paper', 'ok', '2026-01-01', "
    "'{}', '[]', '', '', '{}', '{}')",
    "INSERT INTO idempotency_keys (scope, key, request_digest, status, response, created_at) "
    "VALUES ('POST /episodes', 'k', 'd', 201, '{\"id\": \"e\"}', '2026-01-01')",
)
ROBOT, RIVAL = (Visibility(key, others=False, demonstrations=False, judges_others=False) for key in ("robot", "rival"))


@pytest.fixture(params=["sqlite", "postgres"])
def upgraded(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    """A store whose database was filled at the revision before this one."""
    data = tmp_path / "data"
    data.mkdir()
    if request.param == "sqlite":
        url = f"sqlite:///{data / 'roboprompt.db'}"
    else:
        url = request.getfixturevalue("postgres").empty()
    config = alembic_config()
    with closing(Database(url)) as database, migration_transaction(database) as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0008")
        for statement in BEFORE:
            connection.execute(text(statement.replace(":", "\\:")))
    store = Store.open(data, url)
    yield store
    store.close()


def test_keys_from_before_work_on(upgraded: Store) -> None:
    async def recognised() -> frozenset[str] | None:
        ring = KeyRing(upgraded)
        caller = await ring.recognise(TOKEN)
        await ring.aclose()
        return None if caller is None else caller.scopes

    assert asyncio.run(recognised()) == {"predict"}
    with upgraded.read() as connection:
        (key,) = api_keys.list_all(connection)
    assert (key.tasks, key.expires_at) == (None, None)
    assert key.last_used_at is not None


def test_what_is_from_before_is_nobodys(upgraded: Store) -> None:
    with upgraded.read() as connection:
        assert predictions.get(connection, "old").key_id is None
        with seeing(ROBOT), pytest.raises(NotFoundError):
            predictions.get(connection, "old")
        with seeing(ROBOT):
            assert idempotency.find(connection, "POST /episodes", "k", "d") == StoredResponse(201, {"id": "e"})
            assert idempotency.find(connection, "POST /episodes", "k", "other content") is None


def test_answers_belong_to_who_got_them(store: Store) -> None:
    for visibility, id_ in ((ROBOT, "1"), (RIVAL, "2"), (Visibility(), "3")):
        with seeing(visibility), store.write() as connection:
            assert idempotency.find(connection, idempotency.PREDICT, "k", "d") is None
            idempotency.save(connection, idempotency.PREDICT, "k", "d", StoredResponse(200, {"id": id_}))
    with seeing(RIVAL), store.write() as connection:
        assert idempotency.answered(connection, idempotency.PREDICT, "k") == StoredResponse(200, {"id": "2"})
        idempotency.forget(connection, idempotency.PREDICT, "k")
    with seeing(ROBOT), store.read() as connection:
        assert idempotency.find(connection, idempotency.PREDICT, "k", "d") == StoredResponse(200, {"id": "1"})


def test_predictions_belong_to_who_asked(store: Store) -> None:
    with seeing(ROBOT):
        asked = predict(store, prediction_draft())
    assert asked.key_id == "robot"
    with store.read() as connection:
        for visibility, seen in ((ROBOT, 1), (RIVAL, 0), (Visibility(), 1), (Visibility(tasks=(TASK,)), 1)):
            with seeing(visibility):
                assert len(predictions.list_page(connection).items) == seen
        with seeing(Visibility(tasks=("other",))):
            assert predictions.list_page(connection).items == ()
            with pytest.raises(ForbiddenTaskError, match=f"not for the task '{TASK}', only for 'other'"):
                predictions.list_page(connection, TASK)


@pytest.mark.parametrize(
    ("lent", "visibility", "shown"),
    [
        (None, Visibility("k", (TASK,)), True),
        (["push"], Visibility(), True),
        (["push"], Visibility("k"), True),
        (["push"], Visibility("k", (TASK, "push")), True),
        (["push"], Visibility("k", (TASK,)), False),
        (["push"], Visibility("robot", (TASK,)), True),
        ("similar", Visibility("k", (TASK, "push")), False),
        ("similar", Visibility("robot", (TASK, "push")), True),
    ],
)
def test_what_other_tasks_lent_is_seen_by_keys_for_them(
    store: Store, lent: object, visibility: Visibility, shown: bool
) -> None:
    request = {} if lent is None else {"demonstrations_from": lent}
    with seeing(ROBOT):
        asked = predict(store, replace(prediction_draft(), request=request))
    with seeing(visibility), store.read() as connection:
        for seen in (predictions.get(connection, asked.id), *predictions.list_page(connection).items):
            assert bool(seen.prompt_user) == bool(seen.prompt_system) == shown
            assert seen.reply_text


@pytest.mark.parametrize(
    ("scopes", "others", "demonstrations", "judges_others"),
    [
        (("predict",), False, False, False),
        (("upload", "predict"), False, False, False),
        (("read",), True, True, False),
        (("read", "predict"), True, True, False),
        (("admin",), True, True, True),
    ],
)
def test_what_scopes_let_see(
    store: Store, scopes: tuple[str, ...], others: bool, demonstrations: bool, judges_others: bool
) -> None:
    with store.read() as connection:
        (now,) = connection.execute(text("SELECT CURRENT_TIMESTAMP")).one()
    caller = caller_from(ApiKeyRecord("k", "name", "d", scopes, now, tasks=("pick",)))
    assert caller.visibility == Visibility("k", ("pick",), others, demonstrations, judges_others)
