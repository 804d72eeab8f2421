"""What a person does with the cell's cameras at the terminal: look, and predict."""

import json
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from arms import client_of, type_command
from makers import Body, Plain
from test_cell_cameras import Sensor

from roboprompt_client import cli
from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.rig import MountedCamera, Rig
from roboprompt_client.cameras.sight import Sight
from roboprompt_client.cameras.table import Table
from roboprompt_client.types.camera import Camera, RgbdFrame

pytest.importorskip("cv2", reason="the extra `images` is not installed")
OVERHEAD = np.array([[1.0, 0, 0, 0.4], [0, -1, 0, 0.0], [0, 0, -1, 0.8], [0, 0, 0, 1]])
MODELS = {"mug": {"estimator": "registered"}, "jar": {"estimator": "registered"}}
POSE = {"name": "mug", "position": [0.4, 0.05, 0.04], "quaternion_xyzw": [0, 0, 0, 1], "confidence": 0.9}
JAR = {"title": "Unprocessable", "detail": "objects[jar]: no camera sees a part that has its colors"}


@pytest.fixture
def service(monkeypatch, tmp_path):
    """A service that finds the mug and not the jar; what is sent to it; an arm with a camera above and one in hand."""
    sent, state = [], SimpleNamespace(jars_seen=0, swapped=False)

    def answer(request):
        path = request.url.path
        sent.append((request.method, path, request.read()))
        if path == "/poses":
            state.jars_seen += (of_jar := b'"name": "jar"' in sent[-1][2])
            found = not of_jar or (state.swapped and state.jars_seen > 1)
            return httpx.Response(200, json={"poses": [POSE]}) if found else httpx.Response(422, json=JAR)
        if path == "/tasks/mugs" and request.method == "GET":
            return httpx.Response(200, json={"object_models": MODELS})
        return httpx.Response(200, json={"checks": {}, "id": "p", "actions": [], "findings": []})

    monkeypatch.setattr(cli, "RoboPromptClient", lambda url: client_of(answer))
    arm = Arm(Plain(Body()))
    arm.cameras = Rig(
        [MountedCamera("above", Sensor(), mount=OVERHEAD), MountedCamera("wrist", Sensor(), True, np.eye(4))]
    )
    monkeypatch.setattr("roboprompt_client.commands.shared.open_robot", lambda name: arm)
    monkeypatch.setattr(cli, "open_robot", lambda name: arm)
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "franka"}))
    return SimpleNamespace(sent=sent, state=state, arm=arm, cell=tmp_path / "cell.json")


def run(monkeypatch, *words, answers=()):
    return type_command(monkeypatch, *words, answers=answers)[0]


def paths(service):
    return [path for _, path, _ in service.sent]


def test_look_says_what_is_found_and_why_not(service, monkeypatch, capsys):
    page = service.cell.with_name("look.html")
    assert run(monkeypatch, "look", "--robot", service.cell, "--task", "mugs", "--html", page) == 1
    said = capsys.readouterr().out
    assert "above   64x48   100%         0.800 m       at 0.000 m, tilted by 0.0°" in said
    assert "mug     0.400 0.050 0.040  0°" in said
    assert "jar     NOT FOUND" in said
    assert JAR["detail"] in said
    html = page.read_text()
    assert html.count("<image") == 2
    assert ">mug</text>" in html
    assert "NOT FOUND" in html


def test_look_says_where_a_camera_s_colors_are_swapped(service, monkeypatch, capsys):
    service.state.swapped = True
    run(monkeypatch, "look", "--robot", service.cell, "--task", "mugs", "--find", "jar")
    assert "it is found with red and blue swapped" in capsys.readouterr().out
    first, second = (body for _, path, body in service.sent if path == "/poses")
    assert first != second


def test_look_keeps_the_table_where_no_camera_is_in_doubt(service, monkeypatch, capsys):
    command = ["look", "--robot", service.cell, "--remember"]
    assert run(monkeypatch, *command) == 1  # the camera in the hand sees something else
    assert "table" not in json.loads(service.cell.read_text())
    service.arm.cameras = Rig(service.arm.cameras.cameras[:1])
    assert run(monkeypatch, *command) == 0
    assert json.loads(service.cell.read_text())["table"]["normal"] == [0, 0, 1]
    bumped = OVERHEAD.copy()
    bumped[2, 3] += 0.02
    table = Table.from_json(json.loads(service.cell.read_text())["table"])
    service.arm.cameras = Rig([MountedCamera("above", Sensor(), mount=bumped)], table)
    assert run(monkeypatch, "look", "--robot", service.cell) == 1
    assert "! camera 'above': it sees the table +20 mm and 0.0 degrees off: it was bumped" in capsys.readouterr().out


def test_an_object_that_the_task_does_not_know_is_refused(service, monkeypatch, capsys):
    assert run(monkeypatch, "look", "--robot", service.cell, "--task", "mugs", "--find", "bowl") == 1
    assert "--find: 'bowl' is not known to the task 'mugs'" in capsys.readouterr().err


def test_predict_asks_with_pictures_of_now(service, monkeypatch):
    words = ["--robot", service.cell, "--task", "mugs", "--instruction", "lift the mug"]
    assert run(monkeypatch, "predict", *words) == 0
    assert paths(service)[-1] == "/predict"
    asked = service.sent[-1][2]
    assert b'"objects": [{"name": "mug"}, {"name": "jar"}]' in asked
    assert b'name="rgb_above"' in asked
    assert b"end_effector" in asked


def test_a_sentence_over_several_tasks_needs_the_names_of_what_is_in_view(service, monkeypatch, capsys):
    assert run(monkeypatch, "run", "--robot", service.cell, "--instruction", "lift the mug") == 1
    assert "--find: is missing, and so is --task" in capsys.readouterr().err


def sight(*mounts):
    depth_m = np.full((480, 640), 0.8, np.float32)
    frames = [
        RgbdFrame(Camera(f"cam{k}", 600, 600, 319.5, 239.5, mount), np.zeros((480, 640, 3), np.uint8), depth_m)
        for k, mount in enumerate(mounts)
    ]
    return Sight.of(None, frames, {})


def turned(degrees):
    angle = np.radians(degrees)
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return OVERHEAD @ turn


def test_a_camera_that_was_bumped_is_noticed():
    assert sight(OVERHEAD, OVERHEAD).doubts() == []
    (tilted,) = sight(turned(2.0)).doubts()
    assert tilted.startswith("cam0: the table is tilted by 2.0 degrees")
    higher = OVERHEAD.copy()
    higher[2, 3] += 0.01
    (apart,) = sight(OVERHEAD, higher).doubts()
    assert "cam0 -5 mm, cam1 +5 mm" in apart
    (above,) = sight(OVERHEAD @ np.diag([1.0, -1, -1, 1])).doubts()
    assert "OpenGL axes" in above
