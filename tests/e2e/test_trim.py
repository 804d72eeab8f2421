"""The ends of an episode are trimmed, everywhere, and come back."""

import io

import numpy as np
import pytest

from app.api.schemas.responses import EpisodeOut
from app.cli.export_data import download
from app.untrusted_arrays import film_from_npz
from roboprompt_client import RoboPromptClient
from tests.episodes import arrays, film_npz, jpeg, metadata, multipart, npz, pick_trajectory, refused

PLACE_M = (0.10, 0.05, 0.785)
RECORDED = arrays(pick_trajectory(PLACE_M))  # 21 frames at 20 Hz; closes at 0.55 s, lifts from 0.7 s on
TIMES_S = [0.0, 0.2, 0.45, 1.0]  # of the film's pictures
COMMANDED = {"commanded_positions": RECORDED["end_effector_positions"].tolist()}
TRIM = {"start_s": 0.2, "end_s": 0.8}
KEPT = slice(4, 17)


def teach(http, recorded=RECORDED, film_s=tuple(TIMES_S), task="trimmed"):
    document = metadata(task, {"cube": PLACE_M}, extra=COMMANDED)
    files = multipart(document, npz(**recorded), film_front=film_npz(list(film_s)))
    return http.post("/episodes", files=files).raise_for_status().json()["id"]


@pytest.fixture
def taught(http):
    yield teach(http)
    http.delete("/tasks/trimmed")


def edit(http, id_, trim):
    answer = http.patch(f"/episodes/{id_}", json={"trim": trim})
    assert answer.status_code == 200, answer.text
    EpisodeOut.model_validate_json(answer.content)
    return answer.json()


def test_every_address_has_the_kept_part_and_undoing_brings_all_back(http, taught):
    before = http.get(f"/episodes/{taught}").json()
    version = http.get("/tasks/trimmed").json()["version"]
    after = edit(http, taught, TRIM)
    assert after["trim"] == {"start_s": 0.2, "end_s": 0.8, "first_frame": 4, "end_frame": 17}
    assert (after["num_frames"], http.get("/tasks/trimmed").json()["version"] > version) == (13, True)
    assert [item["index"] + 4 for item in after["keyframes"]] == [11, 16]  # it now begins at rest above the cube
    assert "ends-in-motion" in {item["code"] for item in after["findings"]}
    assert http.get(f"/episodes/{taught}").json() == after
    stored = np.load(io.BytesIO(http.get(f"/episodes/{taught}/trajectory").content))
    for name, array in RECORDED.items():
        np.testing.assert_array_equal(stored[name], array[KEPT])
    film = film_from_npz("front", http.get(f"/episodes/{taught}/films/front").content)
    np.testing.assert_allclose(film.times_s, [0.0, 0.25], atol=1e-9)
    assert http.get(f"/episodes/{taught}/films/front/1").content == jpeg(2)
    assert len(http.get(f"/episodes/{taught}/metadata").json()["extra"]["commanded_positions"]) == 13
    assert (
        edit(http, taught, {"end_s": 0.8})["trim"]["first_frame"] == 0
    )  # of the whole recording, not of what was kept
    restored = edit(http, taught, None)
    assert restored == before
    assert edit(http, taught, {"start_s": 0.0})["trim"] is None


def test_what_is_kept_can_be_uploaded_elsewhere(http, url, taught):
    edit(http, taught, TRIM)
    with RoboPromptClient(url) as client:
        (parcel,) = download(client, [taught])
    document = {**parcel.metadata, "task": "elsewhere"}
    films = {"film_front": parcel.files["film_front"]}
    answer = http.post("/episodes", files=multipart(document, parcel.files["trajectory"], **films))
    assert answer.status_code == 201, answer.text
    assert (answer.json()["num_frames"], answer.json()["trim"]) == (13, None)
    http.delete("/tasks/elsewhere")


def test_films_follow_the_clock_of_the_trajectory(http):
    clocked = {**RECORDED, "timestamps": 1000 + np.arange(21) / 20}
    id_ = teach(http, clocked, [1000 + time_s for time_s in TIMES_S], "clocked")
    edit(http, id_, {"start_s": 0.25, "end_s": 0.4})
    film = film_from_npz("front", http.get(f"/episodes/{id_}/films/front").content)
    np.testing.assert_allclose(film.times_s, [1000.25])
    assert film.pictures == (jpeg(1),)
    http.delete("/tasks/clocked")


def test_an_objects_pose_holds_at_the_beginning(http, taught):
    for start_s, words in ((0.45, "the hand came near cube"), (0.6, "the gripper opened or closed")):
        answer = http.patch(f"/episodes/{taught}", json={"trim": {"start_s": start_s}})
        refused(answer, "trim.start_s", words)
    places, turns = np.tile(np.array(PLACE_M), (21, 1, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (21, 1, 1))
    unturned = teach(http, {**RECORDED, "object_positions": places})
    refused(http.patch(f"/episodes/{unturned}", json={"trim": {"start_s": 0.45}}), "trim.start_s", "came near cube")
    lifted, turned = places.copy(), turns.copy()
    lifted[12:, 0, 2] += 0.1
    turned[12:, 0] = 0.0, 0.0, 0.6, 0.8
    for moved in ((lifted, turns), (places, turned)):
        id_ = teach(http, {**RECORDED, "object_positions": moved[0], "object_quaternions_xyzw": moved[1]})
        refused(http.patch(f"/episodes/{id_}", json={"trim": {"start_s": 0.65}}), "trim.start_s", "cube was moved")
        assert edit(http, id_, {"start_s": 0.45})["num_frames"] == 12


def test_lists_are_filtered(http, taught):
    def listed(**asked):
        answer = http.get("/episodes", params={"task": "trimmed", **asked})
        assert answer.status_code == 200, answer.text
        return [item["id"] for item in answer.json()["episodes"]]

    today = http.get(f"/episodes/{taught}").json()["created_at"][:10]
    assert listed(created_from=today, created_to=today, min_duration_s=1, max_duration_s=1) == [taught]
    assert listed(min_duration_s=1.01) == listed(created_to="2020-01-01") == listed(finding="ends-in-motion") == []
    edit(http, taught, TRIM)
    assert listed(finding="ends-in-motion", max_duration_s=0.7) == [taught]
    refused(http.get("/episodes", params={"created_from": "yesterday"}), "created_from")
    refused(http.get("/predictions", params={"finding": "No Code"}), "finding")
