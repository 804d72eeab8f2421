from concurrent.futures import ThreadPoolExecutor

import pytest

from app.store import audit

from .drafts import read


def note(store, subject):
    with store.write() as connection:
        audit.record(
            connection, "episode.deleted", subject, {"task": "Zoë \N{ROBOT FACE} \0", "at_m": [0.1, 1e-9, -0.0]}
        )


def verified(store):
    with store.read() as connection:
        return list(audit.verified(audit.entries(connection)))


def test_a_chain_holds_in_either_database(store):
    for number in range(3):
        note(store, f"episode {number}")
    first, second, third = verified(store)
    assert (first.number, first.previous) == (1, audit.FIRST)
    assert (second.previous, third.previous) == (first.digest, second.digest)
    assert {entry.actor for entry in (first, second, third)} == {audit.LOCAL}


def test_writers_at_the_same_time_make_one_chain(store):
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda number: note(store, str(number)), range(40)))
    assert [entry.number for entry in verified(store)] == list(range(1, 41))


def test_who_acts_is_named_within_and_no_longer_than_that(store):
    with audit.acting("robot-1 (abc)"):
        note(store, "1")
    note(store, "2")
    assert [entry.actor for entry in verified(store)] == ["robot-1 (abc)", "local"]


def test_an_empty_log_is_whole(store):
    assert verified(store) == []
    assert read(store, audit.newest) is None


@pytest.mark.parametrize("field", ["number", "at", "actor", "action", "subject", "details", "previous"])
def test_every_field_counts(store, field):
    note(store, "1")
    (entry,) = verified(store)
    values = vars(entry)
    other = {"number": 2, "at": entry.at.replace(microsecond=(entry.at.microsecond + 1) % 1_000_000)}
    changed = audit.AuditEntry(**{**values, field: other.get(field, "other")})
    assert changed.expected_digest() != entry.digest
