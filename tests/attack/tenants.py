"""A service whose keys may do different things, and what each has left in it."""

import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cv2
import httpx
import numpy as np

from app.api.access_rules import COOKIE
from app.services.api_keys import create_key
from app.store import api_keys
from app.store.store import Store
from tests.e2e.processes import killable_server
from tests.episodes import arrays, camera, film_npz, metadata, multipart, npz, pick_trajectory

PLACE_M = (0.1, 0.1, 0.78)
PICTURE = cv2.imencode(".png", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()
DEPTH = cv2.imencode(".png", np.full((48, 64), 900, np.uint16))[1].tobytes()
ENVIRONMENT = {
    "ROBOPROMPT_AUTH": "on",
    "ROBOPROMPT_DEFAULT_MODEL": "nearest",
    "ROBOPROMPT_RATE_LIMIT_PER_S": "0",
}
SOON = timedelta(milliseconds=100)
# name: scopes, tasks, expires in
KEYS = {
    "admin": (["admin"], None, None),
    "reader": (["read"], None, None),
    "robot": (["predict"], None, None),
    "rival": (["predict"], None, None),
    "teacher": (["upload", "predict"], None, None),
    "lab": (["read", "predict"], None, None),
    "pick robot": (["predict"], ["pick"], None),
    "pick reader": (["read"], ["pick"], None),
    "pick lab": (["read", "upload", "predict"], ["pick"], None),
    "pick admin": (["admin"], ["pick"], None),
    "expired": (["read", "predict"], None, SOON),
    "revoked": (["read", "predict"], None, None),
}


@dataclass(frozen=True)
class Tenants:
    """The service.

    Attributes:
        clients: by the name of their key.
        tokens: the keys themselves.
        ids: of what was left, by a word for it.
    """

    url: str
    data: Path
    clients: dict[str, httpx.Client]
    tokens: dict[str, str]
    ids: dict[str, str]

    def log_in(self, name):
        """What the cookie of a browser holds that has logged in with the key."""
        answer = httpx.post(f"{self.url}/ui/login", data={"key": self.tokens[name]})
        return answer.cookies[COOKIE]


def question(task="pick", **more):
    return {**metadata(task, {"cube": PLACE_M}), "model": "nearest", **more}


def with_pictures(document):
    return multipart({**document, "cameras": [camera()]}, None, rgb_front=PICTURE, depth_front=DEPTH)


def taught(http, task, headers=None, **more):
    document = metadata(task, {"cube": PLACE_M}, cameras=[camera()], **more)
    trajectory = npz(**arrays(pick_trajectory(PLACE_M)))
    files = multipart(document, trajectory, rgb_front=PICTURE, depth_front=DEPTH, film_front=film_npz([0.0]))
    return http.post("/episodes", files=files, headers=headers)


@contextmanager
def running_tenants(data, environment=None):
    """A service with all keys; `pick` and `push` are taught, and four keys have asked for predictions."""
    data.mkdir(parents=True, exist_ok=True)
    store = Store.open(data)
    tokens = {
        name: create_key(store, name, scopes, tasks, None if ends is None else datetime.now(UTC) + ends)
        for name, (scopes, tasks, ends) in KEYS.items()
    }
    with store.write() as connection:
        api_keys.revoke(connection, tokens["revoked"].split("_")[1])
    store.close()
    time.sleep(SOON.total_seconds())
    with ExitStack() as stack:
        _, url = stack.enter_context(killable_server(data, {**ENVIRONMENT, **(environment or {})}))
        clients = {
            name: stack.enter_context(httpx.Client(base_url=url, headers={"x-api-key": token}, timeout=120))
            for name, token in tokens.items()
        }
        ids = {}
        for task in ("pick", "push"):
            answer = taught(clients["admin"], task)
            assert answer.status_code == 201, answer.text
            ids[f"{task} episode"] = answer.json()["id"]
        for name, task in (("robot", "pick"), ("rival", "pick"), ("admin", "push"), ("lab", "pick")):
            answer = clients[name].post("/predict", files=with_pictures(question(task)))
            assert answer.status_code == 200, answer.text
            ids[f"by {name}"] = answer.json()["id"]
        yield Tenants(url, data, clients, tokens, ids)
