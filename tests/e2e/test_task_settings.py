"""Settings that follow from demonstrations, and settings that are changed one by one."""

import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory, upload

TABLE_M = [(0.0, 0.1, 0.02), (0.1, -0.2, 0.02), (0.3, 0.2, 0.02), (0.25, -0.1, 0.02)]
NEAR_M = (0.255, -0.1, 0.02)
OFFSETS_M = [[0, 0, 0.1], [0, 0, 0], [0, 0, 0.15]]


@pytest.fixture(scope="module")
def table(http):
    """Demonstrations at a height that RLBench's box does not have, and no setting."""
    for place_m in TABLE_M:
        assert upload(http, "table", place_m).status_code == 201
    return "table"


def workspace(http, task):
    document = http.get(f"/tasks/{task}").json()
    return document["version"], document["workspace"]


@pytest.mark.parametrize("representation", ["object_frame", "absolute", "action_tokens"])
def test_demonstrations_on_a_table_work_without_any_setting(http, table, representation):
    fields = {"model": "nearest", "representation": representation}
    response = http.post("/predict", json={**metadata(table, {"cube": NEAR_M}), **fields})
    answer = response.json()
    assert response.status_code == 200, answer
    offsets_m = [np.subtract(action["position"], NEAR_M) for action in answer["actions"]]
    np.testing.assert_allclose(offsets_m, OFFSETS_M, atol=0.012)
    assert [action["gripper_open"] for action in answer["actions"]] == [True, False, False]


def test_a_box_that_a_person_set_stays(http):
    own = {"min": [-1, -1, 0], "max": [1, 1, 1]}
    http.put("/tasks/fixed", json={"workspace": own}).raise_for_status()
    assert upload(http, "fixed", (1.4, 0.0, 0.02)).status_code == 201
    _, box = workspace(http, "fixed")
    assert box == {"preset": None, **own}
    http.put("/tasks/fixed", json={"workspace": "auto"}).raise_for_status()
    _, follows = workspace(http, "fixed")
    assert follows["preset"] == "auto"
    assert follows["max"][0] >= 1.5


def test_each_rule_can_be_chosen_for_what_is_stored(http, table):
    document = metadata("rules", {"cube": TABLE_M[0]})
    sent = http.post("/episodes", files=multipart(document, npz(**arrays(pick_trajectory(TABLE_M[0])))))
    assert len(sent.json()["keyframes"]) == 3
    for rule in ("merged", "waypoints", "uniform", "authors", "auto"):
        assert http.put("/tasks/rules", json={"keyframes": {"rule": rule}}).status_code == 200
        keyframes = http.get(f"/episodes/{sent.json()['id']}").json()["keyframes"]
        assert keyframes, rule
        assert keyframes[-1]["index"] == 20 or rule in ("merged", "auto")


def test_a_change_of_an_older_version_is_refused(http):
    version = http.put("/tasks/shared", json={"num_demonstrations": 3}).json()["version"]
    newer = http.put("/tasks/shared", params={"version": version}, json={"num_demonstrations": 4})
    assert newer.json()["version"] == version + 1
    for name, said in (("shared", f"at version {version + 1}"), ("never made", "is gone")):
        refused = http.put(f"/tasks/{name}", params={"version": version}, json={"num_demonstrations": 5})
        assert (refused.status_code, said in refused.json()["detail"]) == (409, True)
    assert http.get("/tasks/shared").json()["num_demonstrations"] == 4
    with RoboPromptClient(str(http.base_url)) as client, pytest.raises(ServiceProblemError, match="read it again"):
        client.configure_task("shared", version=version, num_demonstrations=5)


@pytest.mark.parametrize("arm", ["ur5", 7, {"urdf": "<robot/>"}])
def test_an_arm_that_is_not_known_is_refused(http, arm):
    response = http.put("/tasks/by name", json={"arm": arm})
    (error,) = response.json()["errors"]
    assert (response.status_code, error["field"]) == (422, "arm")
    assert "panda" in error["valid"]
