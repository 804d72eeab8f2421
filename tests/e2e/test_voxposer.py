"""The baseline over a real service whose model says what a script has."""

import json
import re

import httpx
import pytest

from tests.e2e.processes import running_server
from tests.episodes import metadata

GO = "target = empty_affordance_map()\nset_voxels(target, shifted(detect('cube'), 0, 0, 5))\nmove(target)\n"
LOOP = "for a in range(9999):\n    for b in range(9999):\n        c = a * b\n"
MISSING = "detect('mug')\n"
NO_TARGET = "move(empty_affordance_map())\n"
# The replies come in this order; refused requests ask no model.
REPLIES = [GO, GO, LOOP, MISSING, "", NO_TARGET]
HAND = {"position": [0.0, 0.0, 1.2], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}
CUBE_M = (0.203, 0.104, 0.801)


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    environment = {
        "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps(REPLIES),
        "ROBOPROMPT_DEFAULT_MODEL": "scripted",
        "ROBOPROMPT_WARM_UP": "false",
    }
    with (
        running_server(tmp_path_factory.mktemp("data"), environment) as address,
        httpx.Client(base_url=address, timeout=60) as client,
    ):
        client.put("/tasks/reach", json={"workspace": "rlbench"}).raise_for_status()
        yield client


def ask(http, headers=None, **options):
    body = {**metadata("reach", {"cube": CUBE_M}, "go to the cube"), "method": "voxposer", "end_effector": HAND}
    body |= options
    return http.post("/predict", json={k: v for k, v in body.items() if v is not None}, headers=headers)


def test_programs_are_answered_streamed_shown_and_refused(http):
    answer = ask(http).json()
    assert answer["actions"][-1]["position"] == pytest.approx([0.205, 0.105, 0.855])
    assert (answer["representation"], answer["prompt_format"], answer["demonstration_ids"]) == (
        "voxposer",
        "program",
        [],
    )
    assert answer["reply_text"] == GO

    streamed = ask(http, {"Accept": "text/event-stream"}, stream_text=True).text
    said = re.findall(r"event: text\ndata: (.*)", streamed)
    assert "".join(json.loads(piece)["text"] for piece in said) == GO
    assert streamed.count("event: action") == len(answer["actions"])
    assert "event: done" in streamed

    for reply, why in ((LOOP, "100000 steps"), (MISSING, "no object 'mug'"), ("", "is empty"), (NO_TARGET, "above 0")):
        refused = ask(http)
        problem = refused.json()
        assert refused.status_code == 502
        assert refused.headers["content-type"] == "application/problem+json"
        assert why in problem["detail"]
        assert (problem["type"], problem["reply_text"]) == ("/problems/unparsable-reply", reply)
        assert "actions" not in problem
        stored = http.get(f"/predictions/{problem['prediction_id']}").json()
        assert (stored["status"], stored["request"]["method"]) == ("parse_error", "voxposer")

    for id_ in (answer["id"], problem["prediction_id"]):
        assert http.get(f"/ui/predictions/{id_}").status_code == 200
    form = http.get("/ui/predict", params={"again": answer["id"]})
    assert "<option selected>voxposer</option>" in form.text


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"end_effector": None}, "end_effector"),
        ({"num_samples": 3}, "num_samples"),
        ({"after": "abc"}, "after"),
        ({"method": "kat"}, "method"),
    ],
)
def test_what_means_nothing_to_the_method_is_refused(http, options, field):
    refused = ask(http, **options)
    assert refused.status_code == 422
    assert field in json.dumps(refused.json())


def test_a_dry_run_shows_the_prompt(http):
    shown = ask(http, dry_run=True).json()
    assert shown["prompt"]["user"].endswith('# objects: "cube"\n# task: go to the cube\n')
    assert shown["grammar"] is None
