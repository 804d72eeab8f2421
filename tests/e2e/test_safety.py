"""Nothing unsafe leaves the service, and a person stops the robot at any time."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import Pose
from tests.e2e.processes import killable_server, streamed
from tests.e2e.test_stream import Arm, seen, tracked
from tests.episodes import pick_trajectory

PLACES_M = np.random.default_rng(5).uniform([0.0, -0.3, 0.77], [0.4, 0.3, 0.79], (6, 3)).round(4)
QUERY_M = np.array([0.213, -0.117, 0.78])
PICK = "pick up the cube"
DOWN = (1.0, 0.0, 0.0, 0.0)
REGRESSION = {"model": "regression"}
LLM = {"model": "embedded/gemma-3-270m"}
LOW_BOX = {"min": [-0.3, -0.5, 0.6], "max": [0.7, 0.5, 0.85]}  # in which the cube stands, and no hand above it


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as client:
        yield client


@pytest.fixture
def taught(client, request):
    """A task of six picks (0.1 m above the cube, down, 0.15 m up), of the test's own."""
    task = "".join(character if character.isalnum() else "_" for character in request.node.name)[:64].strip("_")
    teach(client, task)
    return task


def teach(client, task):
    """Six picks in RLBench's workspace, whose bins are 1 cm."""
    client.configure_task(task, workspace="rlbench")
    for place_m in PLACES_M:
        client.upload(task, PICK, tracked(pick_trajectory(place_m), place_m), seen(place_m))


NEAR = Pose(tuple(QUERY_M + np.array([0, 0, 0.2])), DOWN)


def located(place_m=QUERY_M):
    return replace(seen(place_m), end_effector=NEAR)


def refused(client, task, observation=None, **options):
    """The problem that a prediction is answered with."""
    with pytest.raises(ServiceProblemError) as caught:
        client.predict(task, PICK, observation or located(), **{**REGRESSION, **options})
    assert (caught.value.status, caught.value.problem["type"]) == (502, "/problems/unsafe-action")
    return caught.value.problem


def test_a_step_that_is_too_long_names_action_value_and_bound(client, taught):
    client.configure_task(taught, motion_limits={"max_step_m": 0.12})
    problem = refused(client, taught)
    (error,) = problem["errors"]
    assert error["field"] == "actions[2].position"
    assert error["message"].startswith("is 0.15")
    assert error["valid"] == "at most 0.12 m"
    stored = client.get(f"/predictions/{problem['prediction_id']}")
    assert (stored["status"], stored["actions"], stored["reply_text"]) == ("unsafe_action", None, problem["reply_text"])
    assert "at most 0.12 m" in stored["error"]


def test_rows_relative_to_an_object_cannot_leave_the_workspace(client, taught):
    """The real LLM writes offsets that lead out of the task's box: nothing is clipped to its edge."""
    client.configure_task(taught, workspace=LOW_BOX)
    arm = Arm()
    asked = {"representation": "object_frame", "unsupported": "allow", **LLM}
    with pytest.raises(ServiceProblemError, match=r"position\.z is 0\.8") as caught:
        run_task(client, arm, taught, PICK, **asked)
    assert caught.value.problem["errors"][0]["field"] == "actions[0].position.z"
    assert arm.log == ["stop"]


@pytest.mark.parametrize("asked", [LLM, {"model": "nearest"}])
def test_a_scene_from_which_every_plan_leaves_the_workspace_is_refused_before_a_model_is_asked(client, taught, asked):
    client.configure_task(taught, workspace=LOW_BOX)
    before = client.get("/predictions", task=taught)["predictions"]
    said = r"leads out of the workspace: in action 1 .*position\.z is 0\.8"
    with pytest.raises(ServiceProblemError, match=said) as caught:
        run_task(client, Arm(), taught, PICK, **asked)
    assert (caught.value.status, caught.value.problem["title"]) == (
        422,
        "Every demonstrated plan leaves the workspace here",
    )
    assert caught.value.problem["errors"][0]["field"] == "objects[cube]"
    assert client.get("/predictions", task=taught)["predictions"] == before


def test_an_unsafe_action_in_the_middle_of_a_stream_ends_it(client, taught):
    client.configure_task(taught, motion_limits={"max_step_m": 0.12})
    events = [event for event in streamed(client.url, taught, PICK, located(), **REGRESSION) if event[0] != "grounding"]
    assert [name for name, _ in events] == ["findings", "action", "action", "error"]
    assert "action 2: position is 0.15" in events[-1][1]["detail"]


ROWS = "[[51, 38, 27, 0, 36, 36, 1], [51, 38, 17, 0, 36, 36, 0], [51, 38, 32, 0, 36, 36, 0]]"  # as it was taught


def script(url, log, *options, arm_seconds=0.0, **kinds):
    """`roboprompt-robot run` with an arm that takes its time."""
    command = [sys.executable, "-m", "roboprompt_client", "--url", url, "run", "--robot", "tests.e2e.slow_arm:SlowArm"]
    environment = {**os.environ, "ARM_LOG": str(log), "ARM_SECONDS": str(arm_seconds)}
    return subprocess.Popen(
        [*command, "--instruction", PICK, *options], env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True, **kinds
    )  # fmt: skip


@pytest.fixture(scope="module")
def scripted(tmp_path_factory):
    """A service whose model replies three rows at once."""
    environment = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([ROWS]), "ROBOPROMPT_DEFAULT_MODEL": "scripted"}
    with killable_server(tmp_path_factory.mktemp("scripted"), environment) as (_, url), RoboPromptClient(url) as client:
        teach(client, "pick")
        yield url


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_stops_the_robot(scripted, tmp_path, sent):
    log = tmp_path / "arm.log"
    process = script(scripted, log, "--task", "pick", "--yes", arm_seconds=30)
    deadline = time.monotonic() + 30
    while not (log.exists() and log.read_text().endswith("\n")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(sent)
    _, said = process.communicate(timeout=10)
    assert log.read_text().splitlines() == ["to 0.875", "stop"]
    assert process.returncode == 128 + sent
    assert "Traceback" not in said


@pytest.mark.parametrize(("answers", "moved"), [("y\nn\n", ["to 0.875", "stop"]), ("", ["stop"]), ("y\n" * 3, None)])
def test_confirm_asks_before_each_motion(scripted, tmp_path, answers, moved):
    log = tmp_path / "arm.log"
    process = script(scripted, log, "--task", "pick", "--confirm", stdin=subprocess.PIPE)
    said, errors = process.communicate(answers, timeout=30)
    everything = ["to 0.875", "to 0.775", "to 0.925"]
    assert log.read_text().splitlines() == (moved or everything)
    assert process.returncode == (1 if moved else 0)
    assert said.count("Go? [y/N]") == (len(moved) if moved else 3)
    assert not moved or "was not allowed" in errors
    assert errors.startswith("no preview: this robot's geometry is unknown")


BREACH = "action 2: position.z is 0.925 m (allowed: 0.6 to 0.9 m, the workspace)"
LOW_SPACE = {"min": [-1, -1, 0], "max": [1, 1, 0.9]}
SHELF = {"min": [0.0, -0.3, 0.7], "max": [0.4, 0.3, 0.76]}


@pytest.mark.parametrize(
    ("pinned", "said"),
    [
        ({"workspace": LOW_SPACE}, BREACH),
        ({"motion_limits": {"keep_out": [SHELF]}}, "at least 0.05 m (hand_radius_m) outside keep_out[0]"),
        ({"motion_limits": {"max_step_m": 0.2}}, "end_effector: is left out, but max_step_m"),
        ({"motion_limits": {"max_step": 0.2}}, "motion_limits: is {'max_step': 0.2} (valid:"),
        ({"motion_limits": {"hand_radius_m": -1}}, "motion_limits.hand_radius_m: is -1"),
        ("no JSON", "--limits: "),
    ],
)
def test_the_script_keeps_to_limits_in_a_file_of_its_own(scripted, tmp_path, pinned, said):
    log, file = tmp_path / "arm.log", tmp_path / "limits.json"
    file.write_text(pinned if isinstance(pinned, str) else json.dumps(pinned))
    process = script(scripted, log, "--task", "pick", "--limits", str(file))
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert said in errors
    assert "Traceback" not in errors
    assert not log.exists() or log.read_text().splitlines() == ["stop"]
