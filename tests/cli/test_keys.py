"""`roboprompt keys`: which tasks a key is for and until when, as people write it and as it is listed."""

from datetime import UTC, datetime, timedelta

import pytest
import typer
from typer.testing import CliRunner

from app.cli import application
from app.cli.administration import expiry
from app.store import api_keys
from app.store.store import Store

NOW = datetime(2026, 11, 22, 6, 30, tzinfo=UTC)


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("30d", NOW + timedelta(days=30)),
        ("12h", NOW + timedelta(hours=12)),
        ("2w", NOW + timedelta(weeks=2)),
        ("2027-01-31", datetime(2027, 1, 31, tzinfo=UTC)),
        ("2027-01-31T18:00", datetime(2027, 1, 31, 18, tzinfo=UTC)),
        ("2027-01-31T18:00+01:00", datetime(2027, 1, 31, 17, tzinfo=UTC)),
    ],
)
def test_the_end_of_a_key_is_read_from_words_and_dates(text, moment):
    assert expiry(text, NOW) == moment


@pytest.mark.parametrize("text", ["", "soon", "d", "-3d", "3 days", "2027-02-30", "99999999d", "99999w" * 2])
def test_invalid_times_are_refused(text):
    with pytest.raises(typer.BadParameter, match="is not a time, expected 30d"):
        expiry(text, NOW)


def run(data, *words):
    done = CliRunner().invoke(application, ["keys", *words, "--data", str(data)])
    return done.exit_code, done.stdout, done.stderr


def test_a_key_for_two_tasks_and_a_month(tmp_path):
    code, token, _ = run(
        tmp_path, "add", "robot", "--scope", "predict", "--task", "push_button", "--task", "pick", "--expires", "30d"
    )
    assert (code, token[:3]) == (0, "rp_")
    listed = run(tmp_path, "list")[1]
    assert "robot  predict  only push_button, pick  " in listed
    assert "  valid until " in listed
    assert listed.strip().endswith("never used")
    store = Store.open(tmp_path)
    with store.read() as connection:
        (key,) = api_keys.list_all(connection)
    store.close()
    assert key.tasks == ("push_button", "pick")
    assert key.expires_at is not None
    assert abs(key.expires_at - datetime.now(UTC) - timedelta(days=30)) < timedelta(minutes=5)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--task", "a{b"], "task"),
        (["--scope", "write"], "scopes"),
        (["--expires", "2020-01-01"], "has passed"),
        (["--expires", "soon"], "is not a time"),
    ],
)
def test_invalid_options_of_a_key_are_refused(tmp_path, words, said):
    code, _, error = run(tmp_path, "add", "robot", "--scope", "predict", *words)
    assert code != 0
    assert said in error
    assert run(tmp_path, "list")[1] == ""
