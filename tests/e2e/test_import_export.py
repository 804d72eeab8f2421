"""`roboprompt import` and `export` against the running service."""

import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import application
from app.datasets.archive import write_archive
from app.evaluation.server import free_port
from app.pipeline.keyframes import Motion, merged
from app.untrusted_arrays import trajectory_from_npz
from tests.datasets import peract_folder as peract
from tests.datasets.parcels import parcels
from tests.e2e.processes import running_server
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png

PLACES_M = ((0.25, 0.05, 0.9), (0.2, 0.1, 0.9), (0.3, -0.1, 0.9))


def run(*arguments, code=0):
    """The command's summary."""
    result = CliRunner().invoke(application, [*map(str, arguments), "--json"])
    assert result.exit_code == code, result.output
    return json.loads(result.stdout.splitlines()[-1])


@pytest.fixture
def folder(tmp_path):
    """Three episodes in PerAct's layout, and the file that tells of the drawer."""
    for number, place_m in enumerate(PLACES_M):
        peract.write_episode(
            tmp_path / f"open_drawer/all_variations/episodes/episode{number}", pick_trajectory(place_m)
        )
    (tmp_path / "objects.json").write_text(json.dumps([{"name": "drawer", "mask_ids": [peract.DRAWER_ID]}]))
    return tmp_path


def test_rlbench_folder(url, http, folder):
    command = ("import", folder, "--url", url, "--objects", folder / "objects.json", "--task", "rlbench")
    summary = run(*command)
    assert (summary["imported"], summary["already_there"], summary["damaged"]) == (3, 0, [])
    episodes = http.get("/episodes", params={"task": "rlbench"}).json()["episodes"][::-1]
    for episode, place_m in zip(episodes, PLACES_M, strict=True):
        assert [item["index"] for item in episode["keyframes"]] == list(merged(Motion.of(pick_trajectory(place_m))))
        np.testing.assert_allclose(episode["objects"][0]["position"], peract.DRAWER_M, atol=0.01)
        assert episode["objects"][0]["estimator"] == "masks"
        assert episode["objects"][0]["cameras"] == sorted(peract.CAMERAS)
    again = run(*command)
    assert (again["imported"], again["already_there"]) == (0, 3)
    assert len(http.get("/episodes", params={"task": "rlbench"}).json()["episodes"]) == 3


def test_a_damaged_file_is_named_and_the_rest_imported(url, http, folder):
    damaged = folder / "open_drawer/all_variations/episodes/episode1"
    (damaged / "low_dim_obs.pkl").write_bytes(b"no pickle")
    summary = run("import", folder, "--url", url, "--objects", folder / "objects.json", "--task", "hurt", code=1)
    assert summary["imported"] == 2
    (named,) = summary["damaged"]
    assert named["episode"].endswith("episode1")
    assert str(damaged / "low_dim_obs.pkl") in named["reason"]


def test_a_dry_run_reports_and_stores_nothing(http, folder):
    nowhere = f"http://127.0.0.1:{free_port()}"
    command = ("import", folder, "--dry-run", "--url", nowhere, "--task", "dry")
    summary = run(*command, "--objects", folder / "objects.json")
    expected = sum(len(merged(Motion.of(pick_trajectory(place_m)))) for place_m in PLACES_M)
    assert (summary["imported"], summary["keyframes"], summary["tasks"]) == (3, expected, {"dry": 3})
    refused = run(*command, code=1)["refused"]
    assert len(refused) == 3
    assert f"its masks show the ids {peract.DRAWER_ID}, {peract.TABLE_ID}" in refused[0]["reason"]
    assert "--objects FILE" in refused[0]["reason"]
    (folder / "objects.json").write_text('[{"name": "drawer"}]')
    missing = run(*command, "--objects", folder / "objects.json")["missing"]
    assert list(missing.values()) == [3]
    assert "the task's object models must find them" in next(iter(missing))
    assert http.get("/tasks/dry").status_code == 404


def test_a_service_that_is_not_there(folder):
    command = ("import", folder, "--url", f"http://127.0.0.1:{free_port()}", "--objects", folder / "objects.json")
    assert "POST" in run(*command, code=1)["stopped"] or "GET" in run(*command, code=1)["stopped"]


def test_what_was_deleted_can_be_imported_again(url, http, folder):
    command = ("import", folder, "--url", url, "--objects", folder / "objects.json", "--task", "again")
    run(*command)
    gone = http.get("/episodes", params={"task": "again"}).json()["episodes"][0]["id"]
    assert http.delete(f"/episodes/{gone}").status_code == 204
    summary = run(*command)
    assert (summary["imported"], summary["already_there"]) == (1, 2)


def upload_everything(http, task):
    """An episode with arrays as images, which only the original bytes keep."""
    rng = np.random.default_rng(0)
    cameras = [camera(width=64, height=48) | {"intrinsics": {**camera()["intrinsics"], "width": 64, "height": 48}}]
    document = metadata(task, {"cube": (0.1, 0.0, 0.8)}, cameras=cameras, extra={"operator": "me"})
    images = {
        "rgb_front": png(rng.integers(0, 255, (48, 64, 3), np.uint8)),
        "depth_front": npy(rng.uniform(0.5, 1, (48, 64))),
        "mask_front": npy(rng.integers(0, 99, (48, 64))),
    }
    sent = multipart(document, npz(**arrays(pick_trajectory((0.1, 0.0, 0.8)))), **images)
    answer = http.post("/episodes", files=sent)
    assert answer.status_code == 201, answer.text
    return answer.json()["id"], document, images


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def test_everything_of_an_episode_can_be_had(http):
    episode_id, document, images = upload_everything(http, "everything")
    stored = http.get(f"/episodes/{episode_id}/metadata").json()
    assert stored["cameras"] == document["cameras"]
    assert (stored["task"], stored["instruction"], stored["extra"]) == (
        "everything",
        "pick up the cube",
        {"operator": "me"},
    )
    assert stored["objects"][0]["position"] == [0.1, 0.0, 0.8]
    for part, data in images.items():
        kind, _, name = part.partition("_")
        address = f"/episodes/{episode_id}/images/{name}/{kind}"
        assert http.get(address, params={"original": True}).content == data
        assert http.get(address).headers["content-type"] == "image/png"


def test_an_archive_is_the_same_on_another_service(url, http, tmp_path):
    upload_everything(http, "travels")
    http.put("/tasks/travels", json={"num_demonstrations": 7, "keyframes": {"delta_rad_s": 0.05}})
    here, there = tmp_path / "here.zip", tmp_path / "there.zip"
    assert run("export", "--task", "travels", "--archive", here, "--url", url)["episodes"] == 1
    assert run("import", here, "--url", url)["imported"] == 1  # it was uploaded without a key
    assert run("import", here, "--url", url)["already_there"] == 1
    with running_server(tmp_path / "data") as other:
        assert run("import", here, "--url", other)["imported"] == 1
        run("export", "--task", "travels", "--archive", there, "--url", other)
    assert here.read_bytes() == there.read_bytes()


def test_settings_that_are_there_stay(url, http, tmp_path):
    http.put("/tasks/kept", json={"num_demonstrations": 3})
    write_archive(tmp_path / "pick.zip", "pick", {"num_demonstrations": 7}, parcels())
    assert run("import", tmp_path / "pick.zip", "--url", url, "--task", "kept")["imported"] == 3
    assert http.get("/tasks/kept").json()["num_demonstrations"] == 3


def test_lerobot_and_back(url, http, tmp_path):
    write_archive(tmp_path / "pick.zip", "pick", {}, parcels())
    run("import", tmp_path / "pick.zip", "--url", url, "--task", "round")
    run("export", "--task", "round", "--lerobot", tmp_path / "set", "--url", url)
    assert run("import", tmp_path / "set", "--url", url)["already_there"] == 3
    assert run("import", tmp_path / "set", "--url", url, "--task", "round_2")["imported"] == 3
    first, second = (
        trajectory_from_npz(http.get(f"/episodes/{http_id}/trajectory").content)
        for http_id in (
            http.get("/episodes", params={"task": task}).json()["episodes"][0]["id"] for task in ("round", "round_2")
        )
    )
    np.testing.assert_array_equal(first.object_positions_m, second.object_positions_m)
    np.testing.assert_array_equal(first.timestamps_s, second.timestamps_s)


def test_export_refusals(url, tmp_path):
    (tmp_path / "there.zip").touch()
    for target, task in (("there.zip", "round"), ("new.zip", "unheard")):
        result = CliRunner().invoke(
            application, ["export", "--task", task, "--archive", str(tmp_path / target), "--url", url]
        )
        assert result.exit_code == 1
        assert target in result.output or "no task" in result.output
    assert CliRunner().invoke(application, ["export", "--task", "round"]).exit_code == 2
