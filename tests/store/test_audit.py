from concurrent.futures import ThreadPoolExecutor

from app.store import audit
from app.store.visibility import Visibility, seeing


def note(store, subject):
    with store.write() as connection:
        audit.record(
            connection, "episode.deleted", subject, {"task": "Zoë \N{ROBOT FACE} \0", "at_m": [0.1, 1e-9, -0.0]}
        )


def verified(store):
    with store.read() as connection:
        return list(audit.verified(audit.entries(connection)))


def test_writers_at_the_same_time_make_one_chain(store):
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda number: note(store, str(number)), range(40)))
    assert [entry.number for entry in verified(store)] == list(range(1, 41))


def test_the_author_of_a_change_is_known_only_during_it(store):
    with seeing(Visibility(actor="robot-1 (abc)")):
        note(store, "1")
    note(store, "2")
    assert [entry.actor for entry in verified(store)] == ["robot-1 (abc)", "local"]
