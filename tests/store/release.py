"""What a release left in a data folder, as text: NAME.sql is the database and the images, NAME.json what it answered.

    python -m tests.store.release 1.1     # once, when 1.1 is released; what is there is never written again

`tests/store/test_upgrade.py` opens each of them with the code of today.
"""

import json
import sqlite3
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

import httpx
import numpy as np

from app.services.api_keys import create_key
from app.store.blobs import FileBlobStore
from app.store.store import Store
from tests.e2e.processes import killable_server
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png

FOLDER = Path(__file__).with_name("releases")
SETTINGS = {"ROBOPROMPT_DEFAULT_MODEL": "nearest", "ROBOPROMPT_EXTRACT_AT_ONCE": "0"}
PLACES_M = ((0.1, 0.1, 0.78), (0.2, -0.1, 0.78), (0.3, 0.05, 0.78))
QUESTION = metadata("pick", {"cube": (0.15, 0.0, 0.78)})
DEPTH = png(np.full((48, 64), 220, np.uint16))
KEYS = {"Idempotency-Key": "one of the first release"}


def fill(http):
    """Use every part of the service that stores something; returns the addresses of what it then has."""
    ids = []
    for number, place_m in enumerate(PLACES_M):
        document = metadata("pick", {"cube": place_m}, cameras=[camera()], extra={"operator": "Zoë"})
        images = {"rgb_front": png(np.full((48, 64, 3), 40 * number, np.uint8)), "depth_front": DEPTH}
        parts = multipart(document, npz(**arrays(pick_trajectory(place_m))), **images)
        ids.append(said(http.post("/episodes", files=parts, headers={"Idempotency-Key": f"episode {number}"}))["id"])
    label = {"object": "cube", "episode_id": ids[0], "polygons": {"front": [[20, 20], [40, 20], [40, 40], [20, 40]]}}
    said(http.post("/tasks/pick/labels", json=label))
    job = said(http.put("/tasks/pick", json={"keyframes": {"rule": "merged"}}))["id"]
    while said(http.get(f"/jobs/{job}"))["status"] in ("queued", "running"):
        time.sleep(0.1)
    said(http.put("/tasks/pick", json={"num_demonstrations": 2, "workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]}}))
    predicted = said(http.post("/predict", json=QUESTION, headers=KEYS))["id"]
    said(http.post(f"/predictions/{predicted}/outcome", json={"success": True, "note": "slowly"}))
    episodes = [f"/episodes/{name}" for name in ids]
    return ["/tasks/pick", "/tasks/pick/labels", f"/jobs/{job}", f"/predictions/{predicted}", *episodes]


def said(response):
    """The document of an answer, unless it is a problem."""
    assert response.is_success, response.text
    return response.json()


def as_sql(folder):
    """The database and the images of a data folder as SQL; the images are a table of their own."""
    with closing(sqlite3.connect(folder / "roboprompt.db")) as database, database:
        database.execute("CREATE TABLE blobs_of_release (data BLOB)")
        for path in sorted((folder / "blobs").glob("*/*/*")):
            database.execute("INSERT INTO blobs_of_release VALUES (?)", [path.read_bytes()])
        return "\n".join(database.iterdump()) + "\n"


def unpack(name, folder):
    """The data folder of a release."""
    with closing(sqlite3.connect(folder / "roboprompt.db")) as database, database:
        database.executescript((FOLDER / f"{name}.sql").read_text())
        for (data,) in database.execute("SELECT data FROM blobs_of_release").fetchall():
            FileBlobStore(folder / "blobs").put(data)
        database.execute("DROP TABLE blobs_of_release")
        # as if it was written just now: an answer to a repeated prediction is kept for a day
        database.execute("UPDATE idempotency_keys SET created_at = strftime('%Y-%m-%d %H:%M:%f', 'now')")


def main(name):
    """Write NAME.sql and NAME.json, unless they are there."""
    with tempfile.TemporaryDirectory() as place, (FOLDER / f"{name}.sql").open("x") as sql:
        folder = Path(place)
        with killable_server(folder, SETTINGS) as (_, url), httpx.Client(base_url=url, timeout=60) as http:
            answers = {address: said(http.get(address)) for address in fill(http)}
        store = Store.open(folder)
        create_key(store, "robot", ["predict"], ["pick"])
        store.close()
        sql.write(as_sql(folder))
    (FOLDER / f"{name}.json").write_text(json.dumps(answers, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
