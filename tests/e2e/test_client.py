"""The robot's side against the running service."""

import json
import subprocess
import sys

import httpx
import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from tests.episodes import arrays, npz, pick_trajectory

PLACES_M = [(0.11, 0.02, 0.78), (0.21, -0.13, 0.78), (0.3, 0.2, 0.78), (0.05, -0.2, 0.78)]


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as client:
        yield client


def seen(place_m, name="cube"):
    return Observation((ObjectPose(name, np.array(place_m)),))


def frame():
    """A camera 1 m above the table top's origin, looking down at a cube's top 0.22 m below it."""
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    down[2, 3] = 1.0
    mask = np.zeros((48, 64), np.int32)
    mask[20:28, 30:34] = 5
    rgb = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    camera = Camera("front", 60, 60, 31.5, 23.5, down, image_size_px=(64, 48))
    return RgbdFrame(camera, rgb, np.full((48, 64), 0.22, np.float32), mask)


def test_teach_and_ask(client):
    for place_m in PLACES_M:
        document = client.upload("client", "pick up the cube", pick_trajectory(place_m), seen(place_m))
        assert document["num_frames"] == 21
    place_m = np.array([0.17, 0.08, 0.78])
    predicted = client.predict("client", "pick up the cube", seen(place_m), model="regression")
    assert [action.gripper_open for action in predicted.actions] == [True, False, False]
    np.testing.assert_allclose(predicted.actions[1].position_m, place_m, atol=0.02)
    assert client.record_outcome(predicted.id, True)["outcome"]["success"] is True


def test_images_and_masks(client):
    scene = Observation(frames=frame(), mask_ids={"cube": [5]})
    for place_m in PLACES_M[:2]:
        document = client.upload("client_rgbd", "pick up the cube", pick_trajectory(place_m), scene)
    np.testing.assert_allclose(document["objects"][0]["position"], [0, 0, 0.78], atol=1e-3)
    predicted = client.predict("client_rgbd", "pick up the cube", scene, dry_run=False, model="regression")
    assert predicted.response["demonstration_ids"]


def test_problems_carry_what_the_service_said(client):
    with pytest.raises(ServiceProblemError, match="no task 'unheard'") as caught:
        client.predict("unheard", "go", seen((0, 0, 1)))
    assert caught.value.status == 404
    assert caught.value.problem["title"] == "Not found"


def test_the_script(url, tmp_path):
    objects = tmp_path / "objects.json"
    objects.write_text(json.dumps([{"name": "cube", "position": PLACES_M[0]}]))
    scene = ["--task", "script", "--instruction", "pick up the cube", "--objects", str(objects)]

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "roboprompt_client", "--url", url, *words],
            capture_output=True,
            text=True,
            timeout=60,
        )

    trajectory = tmp_path / "episode.npz"
    trajectory.write_bytes(npz(**arrays(pick_trajectory(PLACES_M[0]))))
    for _ in range(2):
        assert len(json.loads(run("upload", *scene, str(trajectory)).stdout)["keyframes"]) == 3
    assert len(json.loads(run("predict", *scene, "--model", "regression").stdout)["actions"]) == 3
    refused = run("predict", *scene, "--model", "nobody")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "there is no model 'nobody'" in refused.stderr


def test_the_example_teaches_presses_and_records_the_outcome(client, url):
    command = [sys.executable, "-m", "roboprompt_client.example", "--url", url]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "\npressed; more at http" in ended.stdout
    prediction = client.get(f"/predictions/{ended.stdout.rsplit('/', 1)[1].strip()}")
    assert prediction["outcome"]["success"] is True
    # A sentence that names no task is read against all of them.
    httpx.delete(f"{url}/tasks/{prediction['task']}").raise_for_status()
