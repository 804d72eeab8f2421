"""Hostile inputs by the hundred: each is refused as documented, nothing of it stays, nobody else waits for it."""

import pytest

from tests.attack.hostile import LIMITED, first_line_of
from tests.attack.hostile_addresses import ADDRESSES, RAW
from tests.attack.hostile_documents import BODIES, LIMITS
from tests.attack.hostile_files import ARCHIVES, IMAGES, LARGE_CLAIMS, ODD_IMAGES, recording, shown
from tests.attack.hostile_forms import FORMS
from tests.attack.watch import peak_mb, watched

MAX_GROWTH_MB = 200
MAX_WAIT_S = 1.0
MAX_ANSWER_BYTES = 20_000
TABLE = {
    f"{kind}: {name}": attack
    for kind, table in {
        "limits": LIMITS,
        "body": BODIES,
        "form": FORMS,
        "archive": {name: recording(ARCHIVES[name]) for name in LARGE_CLAIMS},
        "image": IMAGES,
        "address": ADDRESSES,
    }.items()
    for name, attack in table.items()
}
BOUNDS = {
    "motion_limits": {
        "keep_out": [{"min": [0.5, 0.3, 0.7], "max": [0.6, 0.4, 0.8]}],
        "max_step_m": 0.4,
        "max_step_rotation_deg": 30.0,
    }
}


@pytest.fixture(scope="module")
def before_mb(service, http):
    """The service's memory before the first row."""
    assert http.put(f"/tasks/{LIMITED}", json=BOUNDS).status_code == 200
    return peak_mb(service.process_id)


@pytest.fixture(scope="module")
def kept(http, before_mb):
    """What was stored after the last row; before the first what the service began with."""
    return {"now": stored(http)}


def stored(http):
    """All that rows might leave: whole tasks with their settings, episodes, predictions."""
    return [http.get(address).json() for address in ("/tasks", "/episodes", "/predictions")]


@pytest.mark.parametrize("name", TABLE)
def test_a_hostile_request(service, http, before_mb, kept, name):
    attack, before = TABLE[name], kept["now"]
    with watched(service.process_id, service.url) as toll:
        answer = attack.sent(http)
    assert answer.status_code == attack.status, answer.text[:500]
    assert answer.headers["content-type"] == "application/problem+json"
    assert len(answer.content) < MAX_ANSWER_BYTES
    problem = answer.json()
    assert problem["status"] == attack.status
    if attack.field is not None:
        assert any(error["field"].startswith(attack.field) for error in problem["errors"]), problem
    assert toll.longest_s < MAX_WAIT_S, toll
    assert peak_mb(service.process_id) - before_mb < MAX_GROWTH_MB, toll
    kept["now"] = stored(http)
    assert kept["now"] == before


@pytest.mark.parametrize("name", RAW)
def test_hostile_bytes(service, http, before_mb, kept, name):
    (request, expected), before = RAW[name], kept["now"]
    with watched(service.process_id, service.url) as toll:
        line = first_line_of(service.url, request)
    assert (line == "") if expected is None else line.partition(" ")[2].startswith(expected), line
    assert toll.longest_s < MAX_WAIT_S, toll
    assert peak_mb(service.process_id) - before_mb < MAX_GROWTH_MB, toll
    kept["now"] = stored(http)
    assert kept["now"] == before


@pytest.mark.parametrize("name", ODD_IMAGES)
def test_an_odd_image(service, http, before_mb, kept, name):
    with watched(service.process_id, service.url) as toll:
        answer = shown(ODD_IMAGES[name]).sent(http)
    assert answer.status_code == 200, answer.text[:500]
    assert toll.longest_s < MAX_WAIT_S, toll
    assert peak_mb(service.process_id) - before_mb < MAX_GROWTH_MB, toll
    assert stored(http) == kept["now"]


@pytest.mark.parametrize(
    "bounds",
    [
        {"max_step_m": 5e-324, "max_step_rotation_deg": 5e-324, "hand_radius_m": 5e-324},
        {"max_step_m": 10_000, "max_step_rotation_deg": 180, "hand_radius_m": 1},
        {"keep_out": [{"min": [-10_000] * 3, "max": [10_000] * 3}]},
        {"keep_out": [{"min": [-0.0] * 3, "max": [5e-324] * 3}]},
    ],
    ids=["subnormal", "largest", "all of space", "no size to speak of"],
)
def test_odd_bounds_are_kept_to_the_bit(http, bounds):
    try:
        document = http.put("/tasks/odd", json={"motion_limits": bounds}).json()
        assert {name: document["motion_limits"][name] for name in bounds} == bounds
        assert http.get("/tasks/odd").json() == document
    finally:
        assert http.delete("/tasks/odd").status_code == 204
