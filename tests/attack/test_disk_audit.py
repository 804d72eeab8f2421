"""Who changes the audit log is found out, down to the entry."""

import json
import sqlite3

import httpx
import pytest
from typer.testing import CliRunner

from app.cli import application
from app.services.api_keys import create_key
from app.store import audit
from app.store.store import Store
from tests.e2e.processes import killable_server
from tests.episodes import upload
from tests.store.drafts import episode_draft
from tests.store.drafts import upload as store_upload

ADMIN, LIMITS = "lab (", {"max_step_m": 0.05}


@pytest.fixture
def data(tmp_path):
    store = Store.open(tmp_path / "data")
    for number in range(4):
        with store.write() as connection:
            audit.record(connection, "key.created", str(number), {"name": f"robot-{number}"})
    store.close()
    return tmp_path / "data"


def printed(data, *options):
    done = CliRunner().invoke(application, ["audit", "--data", str(data), *options])
    return done.exit_code, done.stdout.splitlines(), done.stderr


def test_a_whole_log_is_printed(data):
    status, lines, said = printed(data, "--json")
    assert (status, len(lines)) == (0, 4)
    assert json.loads(lines[0]) | {"actor": "local", "action": "key.created", "subject": "0"} == json.loads(lines[0])
    assert "4 entries, unbroken" in said


@pytest.mark.parametrize(
    ("statement", "entry"),
    [
        ("UPDATE audit_log SET actor = 'somebody' WHERE number = 2", 2),
        ("UPDATE audit_log SET at = '2020-01-01 00:00:00.000000' WHERE number = 1", 1),
        ("UPDATE audit_log SET details = '{}' WHERE number = 4", 4),
        ("UPDATE audit_log SET digest = previous WHERE number = 3", 3),
        ("UPDATE audit_log SET details = x'7b7d' WHERE number = 2", 2),
        ("UPDATE audit_log SET subject = x'ff' WHERE number = 4", 4),
        ("UPDATE audit_log SET at = x'00' WHERE number = 3", 3),
        ("UPDATE audit_log SET at = 'long ago' WHERE number = 2", 2),
        ("UPDATE audit_log SET digest = x'00' WHERE number = 4", 4),
        ("DELETE FROM audit_log WHERE number = 1", 1),
        ("DELETE FROM audit_log WHERE number = 3", 3),
        ("UPDATE audit_log SET number = number + 1 WHERE number = 4", 4),
    ],
)
def test_the_first_changed_entry_is_named(data, statement, entry):
    with sqlite3.connect(data / "roboprompt.db") as connection:
        connection.execute(statement)
    connection.close()
    status, lines, said = printed(data)
    assert (status, len(lines)) == (1, entry - 1)
    assert f"entry {entry}:" in said


def test_an_entry_that_is_forged_with_its_digest_breaks_the_next(data):
    """Whoever computes the digest again must do so for all that follow."""
    store = Store.open(data)
    with store.read() as connection:
        second = list(audit.entries(connection))[1]
    store.close()
    forged = audit.AuditEntry(**{**vars(second), "actor": "somebody"})
    with sqlite3.connect(data / "roboprompt.db") as connection:
        change = "UPDATE audit_log SET actor = ?, digest = ? WHERE number = 2"
        connection.execute(change, (forged.actor, forged.expected_digest()))
    connection.close()
    status, lines, said = printed(data)
    assert (status, len(lines)) == (1, 2)
    assert "entry 3: does not follow the entry before it" in said


def test_a_log_whose_newest_entry_was_spoiled_goes_on_and_shows_it(data):
    with sqlite3.connect(data / "roboprompt.db") as connection:
        connection.execute("UPDATE audit_log SET at = x'00', digest = x'00' WHERE number = 4")
    connection.close()
    store = Store.open(data)
    with store.write() as connection:
        audit.record(connection, "key.created", "another")
    store.close()
    status, lines, said = printed(data)
    assert (status, len(lines), "entry 4:" in said) == (1, 3, True)


def test_a_truncated_log_lacks_a_digest_that_was_kept_elsewhere(data):
    newest = json.loads(printed(data, "--json")[1][-1])["digest"]
    assert printed(data, "--holds", newest)[0] == 0
    with sqlite3.connect(data / "roboprompt.db") as connection:
        connection.execute("DELETE FROM audit_log WHERE number = 4")
    connection.close()
    assert printed(data)[0] == 0
    status, _, said = printed(data, "--holds", newest)
    assert (status, "cut off or replaced" in said) == (1, True)


def test_what_is_done_over_http_is_noted_with_the_keys_name(tmp_path):
    data = tmp_path / "data"
    store = Store.open(data)
    token = create_key(store, "lab", ["admin"])
    store.close()
    key = {"authorization": f"Bearer {token}"}
    environment = {"ROBOPROMPT_AUTH": "on"}
    with killable_server(data, environment) as (_, url), httpx.Client(base_url=url, headers=key, timeout=60) as http:
        episode = upload(http, "pick", (0.1, 0.1, 0.78)).json()["id"]
        assert http.put("/tasks/pick", json={"num_demonstrations": 3}).is_success
        assert http.put("/tasks/pick", json={"motion_limits": LIMITS}).is_success
        assert http.put("/tasks/pick", json={"motion_limits": LIMITS}).is_success
        assert http.delete(f"/episodes/{episode}").status_code == 204
        assert http.delete(f"/episodes/{episode}").status_code == 404
    status, lines, _ = printed(data, "--json")
    entries = [json.loads(line) for line in lines]
    assert status == 0
    uploaded_set_deleted = ["limits.changed", "limits.changed", "episode.deleted", "limits.changed"]
    assert [entry["action"] for entry in entries] == ["key.created", *uploaded_set_deleted]
    assert [entry["actor"].startswith(ADMIN) for entry in entries] == [False, True, True, True, True]
    change = json.loads(entries[2]["details"])
    assert [change[when]["motion_limits"]["max_step_m"] for when in ("before", "after")] == [None, 0.05]
    assert entries[3]["subject"] == episode
    assert token not in "".join(lines)


def test_keys_are_noted_when_they_are_made_and_taken_back(tmp_path):
    folder = ["--data", str(tmp_path / "data")]
    token = CliRunner().invoke(application, ["keys", "add", "robot", "--scope", "read", *folder]).stdout.strip()
    key_id = token.split("_")[1]
    for _ in range(2):
        assert CliRunner().invoke(application, ["keys", "revoke", key_id, *folder]).exit_code == 0
    entries = [json.loads(line) for line in printed(tmp_path / "data", "--json")[1]]
    assert [entry["action"] for entry in entries] == ["key.created", "key.revoked"]
    assert {entry["subject"] for entry in entries} == {key_id}


def test_an_audit_entry_is_stored_with_its_change_or_not_at_all(tmp_path):
    store = Store.open(tmp_path / "data")
    episode = store_upload(store, episode_draft(1))
    from app.store import episodes

    def fail_after_deleting():
        with store.write() as connection:
            episodes.remove(connection, episode.id)
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_after_deleting()
    with store.read() as connection:
        assert list(audit.entries(connection)) == []
    store.close()
