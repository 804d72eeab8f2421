"""A cell's file from answers and from what the arm measures."""

import json

import numpy as np
import pytest
from arms import type_command
from makers import Body, xarm

from roboprompt_client.cell import open_robot


@pytest.fixture
def body(monkeypatch):
    body = Body()
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(body))
    return body


def run(monkeypatch, path, answers):
    return type_command(monkeypatch, "init", path, answers=answers)[0]


def guided(body, position_m):
    def guide():
        body.position_m = np.array(position_m)
        return ""

    return guide


def test_a_file_that_opens(body, monkeypatch, tmp_path, capsys):
    path = tmp_path / "cell.json"
    (tmp_path / "objects.json").write_text('[{"name": "cube", "position": [0.3, 0, 0.1]}]')
    corners = [guided(body, [0.2, -0.3, 0.0]), guided(body, [0.6, 0.3, 0.5])]
    answers = [
        "nothing",
        "xarm",
        "192.168.1.5",
        "0.1 x",
        "0.1, 0, 0.6",
        "90",
        "none.json",
        "objects.json",
        "y",
        *corners,
        "y",
    ]
    assert run(monkeypatch, path, answers) == 0
    cell = json.loads(path.read_text())
    assert cell["options"] == {"address": "192.168.1.5"}
    np.testing.assert_allclose(cell["base_to_world"]["quaternion_xyzw"], [0, 0, 0.5**0.5, 0.5**0.5])
    np.testing.assert_allclose(cell["limits"]["workspace"]["min"], [-0.21, 0.19, 0.59], atol=1e-6)
    np.testing.assert_allclose(cell["limits"]["workspace"]["max"], [0.41, 0.61, 1.11], atol=1e-6)
    assert 0.05 < cell["open_width_m"] < 0.1
    assert open_robot(str(path)).observe().objects[0].name == "cube"
    said = capsys.readouterr().out
    assert "'nothing' is none of franka, ur, xarm" in said
    assert "'0.1 x' is not 3 numbers" in said
    assert "none.json cannot be read" in said


def test_a_factory_of_one_s_own_is_given_its_options(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(Body()))
    path = tmp_path / "cell.json"
    answers = ["roboprompt_client.arms.xarm:XArm", "[1]", "{", '{"address": "192.168.1.5"}', "", "", "", "n", "n"]
    assert run(monkeypatch, path, answers) == 0
    assert json.loads(path.read_text())["options"] == {"address": "192.168.1.5"}
    assert "'[1]' is no JSON object" in capsys.readouterr().out


def test_cameras_that_are_plugged_in_are_asked_about(body, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("roboprompt_client.commands.init.realsense_serials", lambda: ["41", "42", "43"])
    path = tmp_path / "cell.json"
    answers = ["xarm", "192.168.1.5", "", "", "fr@nt", "front", "n", "", "wrist", "y", "n", "n"]
    assert run(monkeypatch, path, answers) == 0
    front, wrist = json.loads(path.read_text())["cameras"]
    named = {"name": "front", "driver": "realsense", "options": {"serial": "41"}}
    assert front == {**named, "camera_to_world": None}
    assert (wrist["name"], wrist["options"], wrist["camera_to_hand"]) == ("wrist", {"serial": "43"}, None)
    assert "calibrate --robot" in capsys.readouterr().out


def test_corners_without_room_are_asked_for_again(body, monkeypatch, tmp_path, capsys):
    flat = [guided(body, [0.2, -0.3, 0.0]), guided(body, [0.6, 0.3, 0.01])]
    corners = [*flat, guided(body, [0.2, -0.3, 0.0]), guided(body, [0.6, 0.3, 0.4])]
    assert run(monkeypatch, tmp_path / "cell.json", ["xarm", "a", "", "", "", "y", *corners, "n"]) == 0
    assert "every side must be at least 0.05 m" in capsys.readouterr().out


def test_a_space_that_cannot_be_measured_is_left_out(body, monkeypatch, tmp_path):
    path = tmp_path / "cell.json"
    assert run(monkeypatch, path, ["xarm", "a", "", "", "", "y", "", "q", "n"]) == 0
    assert "limits" not in json.loads(path.read_text())


def test_nothing_is_overwritten(body, monkeypatch, tmp_path, capsys):
    path = tmp_path / "cell.json"
    path.write_text("mine")
    assert run(monkeypatch, path, []) == 1
    assert "exists" in capsys.readouterr().err
    assert path.read_text() == "mine"


def test_a_missing_package_is_said_before_more_is_asked(monkeypatch, tmp_path, capsys):
    status, asked = type_command(monkeypatch, "init", tmp_path / "cell.json", answers=["ur", "192.168.1.5", "ur5e"])
    assert (status, len(asked)) == (1, 3)
    assert "in a checkout, pip install './client[ur]'" in capsys.readouterr().err
    status, asked = type_command(monkeypatch, "init", tmp_path / "none" / "cell.json")
    assert (status, len(asked)) == (1, 0)


@pytest.mark.parametrize(
    "answers", [["xarm"], ["xarm", "a", "", "", "", "y", ""]], ids=["before", "between two corners"]
)
def test_a_person_who_goes_away_leaves_no_file(body, monkeypatch, tmp_path, answers):
    assert run(monkeypatch, tmp_path / "cell.json", answers) == 1
    assert not (tmp_path / "cell.json").exists()
