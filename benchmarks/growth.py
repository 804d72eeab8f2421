"""What list, predict and upload cost with 1,000, 10,000 and 100,000 episodes stored; writes docs/results/growth.md.

`python -m benchmarks.growth [--no-postgres]`. The tables are filled directly; the LLM is scripted: its time is nil.
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from uuid import uuid4

import httpx
from sqlalchemy import delete, insert, select

from app.evaluation.tables import TextTable
from app.store import tables
from app.store.store import Store, blob_digests
from tests.episodes import metadata
from tests.postgres import running_postgres
from tests.reliability.service import TASK, serving, upload_files

SIZES = (1_000, 10_000, 100_000)
REPEATS = 20
NUM_TASKS = 20  # the episodes belong to so many tasks; that which is asked has a twentieth, at least ten
REPORT = Path(__file__).parents[1] / "docs/results/growth.md"


def fill(store, size):
    """Copy the first episode (its rows, not its images) until there are `size`."""
    columns = [column.name for column in tables.episodes.c if column.name != "sequence"]
    with store.write() as connection:
        model = dict(connection.execute(select(tables.episodes).limit(1)).mappings().one())
        task = dict(connection.execute(select(tables.tasks)).mappings().first())
        connection.execute(delete(tables.episodes).where(tables.episodes.c.sequence > 10))
        for number in range(1, NUM_TASKS):
            if connection.scalar(select(tables.tasks.c.name).where(tables.tasks.c.name == f"{TASK}{number}")) is None:
                connection.execute(insert(tables.tasks).values({**task, "name": f"{TASK}{number}"}))
        made = [{name: model[name] for name in columns} for _ in range(1000)]
        for start in range(0, size, 1000):
            for k, row in enumerate(made):
                row["id"] = uuid4().hex
                row["task"] = TASK if (start + k) % NUM_TASKS == 0 else f"{TASK}{(start + k) % NUM_TASKS}"
                digest = uuid4().hex * 2
                row["cameras"] = [{**model["cameras"][0], "rgb": digest}]
            connection.execute(insert(tables.episodes), made)


def timed(ask):
    """Median and worst of a request in ms."""
    ask()
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        ask().raise_for_status()
        times.append(1000 * (time.perf_counter() - started))
    return statistics.median(times), max(times)


def measure(url):
    """Each request's median and worst in ms."""
    number = iter(range(10**6, 10**9))
    question = metadata(TASK, {"cube": (0.2, 0.1, 0.8)})
    with httpx.Client(base_url=url, timeout=300) as http:
        newest = http.get("/episodes", params={"task": TASK, "limit": 1}).json()["episodes"][0]["id"]
        asks = {
            "GET /episodes?task (50)": lambda: http.get("/episodes", params={"task": TASK}),
            "GET /episodes (50)": lambda: http.get("/episodes"),
            "GET /episodes/ID": lambda: http.get(f"/episodes/{newest}"),
            "GET /tasks": lambda: http.get("/tasks"),
            "POST /predict": lambda: http.post("/predict", json=question),
            "POST /predict, nearest": lambda: http.post("/predict", json={**question, "selection": "nearest"}),
            "POST /predict, random": lambda: http.post("/predict", json={**question, "selection": "random"}),
            "POST /episodes": lambda: http.post("/episodes", files=upload_files(next(number))),
        }
        return {name: timed(ask) for name, ask in asks.items()}


def grow(data, environment, database_url):
    """The figures by size."""
    with serving(data, environment) as service:
        for number in range(10):
            httpx.post(f"{service.url}/episodes", files=upload_files(number)).raise_for_status()
        service.stop()
    figures = {}
    for size in SIZES:
        store = Store.open(data, database_url)
        fill(store, size)
        started = time.perf_counter()
        with store.read() as connection:
            blob_digests(connection)
        sweep_s = time.perf_counter() - started
        store.close()
        (data / ".swept").unlink(missing_ok=True)
        with serving(data, environment) as service:
            figures[size] = measure(service.url) | {"references of the sweep, once": (1000 * sweep_s, 1000 * sweep_s)}
            service.stop()
        sys.stdout.write(json.dumps({size: figures[size]}) + "\n")
        sys.stdout.flush()
    return figures


def table(figures):
    rows = [
        [name, *(f"{of[name][0]:.1f} ({of[name][1]:.0f})" for of in figures.values())]
        for name in next(iter(figures.values()))
    ]
    return TextTable(["request, ms: median (worst)", *(f"{size:,}" for size in figures)], [rows]).markdown()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-postgres", action="store_true", help="SQLite only")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="roboprompt-growth-") as folder:
        parts = [("SQLite", table(grow(Path(folder) / "data", {}, None)))]
        if not asked.no_postgres:
            with running_postgres() as server:
                url = server.empty()
                environment = {"ROBOPROMPT_DATABASE_URL": url}
                parts.append(("PostgreSQL", table(grow(Path(folder) / "other", environment, url))))
    head = (
        f"# Cost as the store grows\n\n`make growth`, {datetime.now(UTC):%Y-%m-%d}; one worker, one client on the same "
        f"machine, a scripted LLM, {NUM_TASKS} tasks with a twentieth of the episodes each.\n"
    )
    REPORT.write_text(head + "".join(f"\n## {name}\n\n{text}\n" for name, text in parts))


if __name__ == "__main__":
    main()
