"""Another process that opens the same SQLite file and closes it again, while the service writes."""

import sqlite3
import subprocess
import sys

from app.store import tasks
from app.store.store import Store

LOOK = (
    "import sqlite3, sys; connection = sqlite3.connect(sys.argv[1]);"
    " print(connection.execute('select count(*) from tasks').fetchone()[0])"
)


def counted(path):
    """The number of tasks that a process of its own sees; it closes the file as it ends."""
    seen = subprocess.run([sys.executable, "-c", LOOK, path], capture_output=True, text=True, check=True)
    return int(seen.stdout)


def test_the_log_stays_and_nothing_is_lost(tmp_path):
    store, path = Store.open(tmp_path), tmp_path / "roboprompt.db"
    try:
        with store.write() as connection:
            tasks.get_or_create(connection, "one", {})
        with store.read(), store.read():  # further connections are opened while the first hold their locks
            pass
        assert counted(path) == 1
        assert path.with_name("roboprompt.db-wal").exists()
        with store.write() as connection:
            tasks.get_or_create(connection, "two", {})
        assert counted(path) == 2
        with sqlite3.connect(path) as connection:
            assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        connection.close()
    finally:
        store.close()
