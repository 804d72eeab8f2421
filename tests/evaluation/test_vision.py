"""Tasks taught and tested with images only, on a real service."""

import json
from dataclasses import replace

import httpx
import numpy as np
import pytest
from rich.progress import Progress

from app.evaluation import run, trials
from app.evaluation.ledger import Ledger
from app.evaluation.methods import REGRESSION, with_poses
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.teach import FIRST_LABELED_SEED, Lesson, images_only, with_object_models
from app.evaluation.world import Panda
from app.sim.demonstrate import view_scene
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.types.quaternions import yaw_rad
from tests.e2e.processes import running_server
from tests.evaluation.test_run import InlineExecutor

(VISION,) = with_poses([REGRESSION], "vision")
LABELED_SCENES = 3  # enough for these scenes, and quick
NAMES = ["block", "green target"]


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    environment = {"ROBOPROMPT_DEFAULT_MODEL": "regression"}
    with running_server(tmp_path_factory.mktemp("data"), environment) as address:
        yield address


def run_plan(url, folder, task, episodes=1, num_cameras=2):
    plan = Plan((task,), (VISION,), episodes, 2, "roboprompt eval", Panda(num_cameras=num_cameras))
    with (
        pytest.MonkeyPatch.context() as patch,
        Ledger(folder / "results.jsonl") as ledger,
        RoboPromptClient(url) as client,
    ):
        patch.setattr(run, "LABELED_SCENES", LABELED_SCENES)
        run.PlanRun(plan, ledger, client, InlineExecutor(), Progress(disable=True))()
        (evaluated,) = evaluation_of(plan, ledger).tasks
    return evaluated


@pytest.fixture(scope="module")
def trial(url, tmp_path_factory):
    folder = tmp_path_factory.mktemp("slide_block")
    (trial,) = run_plan(url, folder, "slide_block").trials
    assert json.loads((folder / "results.jsonl").read_text())["answer"]["objects"] == trial.answer["objects"]
    return trial


def test_the_service_finds_the_objects_of_a_test(trial):
    assert [item["name"] for item in trial.answer["objects"]] == NAMES
    for found, true in zip(trial.answer["objects"], trial.scene.objects, strict=True):
        assert found["estimator"] == "cuboid"
        np.testing.assert_allclose(found["position"], true.position_m, atol=0.004)
    assert trial.execution is not None
    assert trial.scene.frames == ()


def test_neither_poses_nor_masks_are_sent(trial, url):
    stored = httpx.get(f"{url}/predictions/{trial.answer['id']}").json()
    assert stored["request"]["objects"] == [{"name": name} for name in NAMES]
    assert len(stored["cameras"]) == 2
    task = stored["task"]
    assert list(httpx.get(f"{url}/tasks/{task}").json()["object_models"]) == NAMES
    for id_ in trial.answer["demonstration_ids"]:
        episode = httpx.get(f"{url}/episodes/{id_}").json()
        assert {item["estimator"] for item in episode["objects"]} == {"cuboid"}
        scene = view_scene("slide_block", episode["extra"]["seed"], cameras=())
        for found, true in zip(episode["objects"], scene.objects, strict=True):
            np.testing.assert_allclose(found["position"], true.position_m, atol=0.004)


def test_models_are_learned_from_scenes_of_their_own(trial, url):
    task = httpx.get(f"{url}/predictions/{trial.answer['id']}").json()["task"]
    labeled = httpx.get(f"{url}/episodes", params={"task": f"{task}.labels"}).json()["episodes"]
    taught = [httpx.get(f"{url}/episodes/{item['id']}").json() for item in labeled[::-1]]
    assert [item["extra"]["seed"] for item in taught] == [FIRST_LABELED_SEED + k for k in range(LABELED_SCENES)]


def test_what_is_no_box_is_found_by_what_it_looked_like(url, tmp_path):
    (trial,) = run_plan(url, tmp_path, "put_in_drawer", num_cameras=3).trials
    block, drawer = trial.answer["objects"]
    assert (block["estimator"], drawer["estimator"]) == ("cuboid", "registered")
    assert set(drawer["cameras"]) >= {"front", "left_shoulder"}
    found, true = (yaw_rad(item) for item in (drawer["quaternion_xyzw"], trial.scene.objects[1].quaternion_xyzw))
    off_deg = np.degrees(found - true) % 90  # its x axis is an arrow that points away from the robot
    assert min(off_deg, 90 - off_deg) < 5.5  # as good as the arrow
    assert trial.execution is not None


def test_a_task_whose_objects_cannot_be_learned_is_an_error_with_the_reason(url, tmp_path):
    evaluated = run_plan(url, tmp_path, "open_drawer", episodes=2, num_cameras=1)
    assert evaluated.trials == ()
    assert [crash.seed for crash in evaluated.crashes] == [100_000, 100_001]
    assert "TeachingError: bottom drawer cannot be found in images:" in evaluated.crashes[0].message
    assert "is undecided: " in evaluated.crashes[0].message


@pytest.mark.parametrize(
    ("model", "symmetries"),
    [
        ({"estimator": "registered", "symmetric": "none"}, {"lid": 0.0}),
        ({"estimator": "registered", "symmetric": "yaw"}, {"lid": 0.0, "cup": 0.0}),
        ({"estimator": "registered", "symmetric": 180.0}, {"lid": 0.0, "cup": 180.0}),
        ({"estimator": "cuboid"}, {"lid": 0.0, "cup": 90.0}),
    ],
)
def test_labels_say_how_symmetric_an_object_is(model, symmetries):
    settings = with_object_models({"yaw_symmetry_deg": {"lid": 0.0, "cup": 90.0}}, {"cup": model})
    assert settings == {"yaw_symmetry_deg": symmetries, "object_models": {"cup": model}}


def test_a_scene_that_cannot_be_read_is_a_failure(url, monkeypatch, trial):
    def in_the_dark(frames, objects):
        seen = images_only(frames, objects)
        return replace(seen, frames=tuple(replace(frame, rgb=np.zeros_like(frame.rgb)) for frame in seen.frames))

    monkeypatch.setattr(trials, "images_only", in_the_dark)
    task = httpx.get(f"{url}/predictions/{trial.answer['id']}").json()["task"]
    with RoboPromptClient(url) as client:
        runner = trials.TrialRunner(client, InlineExecutor())
        failed = runner.run(trials.PlannedTrial("slide_block", 100_000, VISION), Lesson(task, ()))
    assert not failed.succeeded
    assert (failed.answer, failed.execution) == (None, None)
    assert "no camera sees it" in failed.failure
