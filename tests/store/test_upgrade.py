"""The data folder of every release opens with the code of today, and says at least what it said then.

A change of the tables without a migration fails here, also where somebody rewrites the first migration instead.
"""

import json
import shutil

import httpx
import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import func, select

from app.store import audit
from app.store.store import Store
from app.store.tables import metadata as tables
from tests.e2e.processes import killable_server
from tests.store.release import FOLDER, KEYS, QUESTION, SETTINGS, said, unpack

STEP_OF_LOOP = "step"  # of a prediction; null without a closed loop, which went
RELEASES = sorted(path.stem for path in FOLDER.glob("*.sql"))


@pytest.fixture(scope="module", params=RELEASES)
def release(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("release")
    unpack(request.param, folder)
    return folder, json.loads((FOLDER / f"{request.param}.json").read_text())


@pytest.fixture
def upgraded(release, tmp_path):
    """A copy of the folder, opened by the code of today."""
    shutil.copytree(release[0], tmp_path / "data")
    store = Store.open(tmp_path / "data")
    yield store
    store.close()


def test_an_upgraded_database_has_the_present_tables(upgraded):
    with upgraded.read() as connection:
        assert compare_metadata(MigrationContext.configure(connection), tables) == []


def test_every_row_is_there_and_the_audit_log_holds(upgraded):
    with upgraded.read() as connection:
        names = ("tasks", "episodes", "predictions", "labels", "jobs", "api_keys", "idempotency_keys")
        rows = {name: connection.scalar(select(func.count()).select_from(tables.tables[name])) for name in names}
        assert rows == dict(zip(names, (1, 3, 1, 1, 1, 1, 4), strict=True))
        assert len(list(audit.verified(audit.entries(connection)))) == 3


def lost(then, now, where=""):
    """What `then` has and `now` has not; new members are none."""
    if isinstance(then, dict) and isinstance(now, dict):
        kept = [key for key in then if (key, then[key]) != (STEP_OF_LOOP, None)]
        return [item for key in kept for item in lost(then[key], now.get(key, "nothing"), f"{where}/{key}")]
    if isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        return [item for k in range(len(then)) for item in lost(then[k], now[k], f"{where}/{k}")]
    return [] if then == now else [f"{where}: {then} became {now}"]


def test_the_service_answers_the_same_after_the_upgrade(release, tmp_path):
    folder, answers = release
    shutil.copytree(folder, tmp_path / "data")
    with killable_server(tmp_path / "data", SETTINGS) as (_, url), httpx.Client(base_url=url, timeout=60) as http:
        now = {address: said(http.get(address)) for address in answers}
        assert lost(answers, now) == []
        for episode in now["/tasks/pick/labels"]["labels"]:
            image = http.get(f"/episodes/{episode['episode_id']}/images/front/rgb")
            assert image.is_success
        (prediction,) = (answer for address, answer in now.items() if address.startswith("/predictions/"))
        assert said(http.post("/predict", json=QUESTION, headers=KEYS))["id"] == prediction["id"]
        asked_again = said(http.post("/predict", json=QUESTION))
        assert [action["gripper_open"] for action in asked_again["actions"]] == [
            action["gripper_open"] for action in prediction["actions"]
        ]
