"""What a person does at the arm: record, and send; and the cell's file."""

import json
import os
import pty
import threading
import time
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from arms import client_of, type_command
from makers import Body, Plain

from roboprompt_client import cli
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.cell import open_robot
from roboprompt_client.commands.record import offer_correction, record_live
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction
from roboprompt_client.types.quaternions import about_z

OPENED = "roboprompt_client.commands.record.open_robot"
OBJECTS = [{"name": "cube", "position": [0.3, 0, 0.1]}]
STORED = {
    "id": "e1",
    "keyframes": [{}, {}],
    "findings": [{"severity": "info", "code": "long-rest", "message": "The hand stands still for 9 s."}],
}


@pytest.fixture
def service(monkeypatch, tmp_path):
    """Answers 201 unless it is away or refuses."""
    state = SimpleNamespace(away=False, refuses=False, sent=[])

    def answer(request):
        if state.away:
            raise httpx.ConnectError("refused")
        if request.method == "GET":
            return httpx.Response(404, json={"title": "Not found", "detail": "there is no task 'pick'"})
        if state.refuses:
            return httpx.Response(422, json={"title": "Unprocessable", "detail": "cube: no such object"})
        state.sent.append((request.headers["Idempotency-Key"], request.content))
        return httpx.Response(201, json=STORED)

    monkeypatch.setattr(cli, "RoboPromptClient", lambda url: client_of(answer))
    monkeypatch.setattr(OPENED, lambda name: Arm(Plain(Body())))
    (tmp_path / "objects.json").write_text(json.dumps(OBJECTS))
    return state


def run(monkeypatch, tmp_path, *more, answers=()):
    words = ["record", "--robot", "cell.json", "--task", "pick", "--instruction", "pick it up"]
    words += ["--objects", tmp_path / "objects.json", "--folder", tmp_path / "kept", *more]
    return type_command(monkeypatch, *words, answers=answers)[0]


def kept(tmp_path):
    return sorted((tmp_path / "kept").iterdir()) if (tmp_path / "kept").exists() else []


def test_record_keep_and_upload(service, monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, answers=["", "", "q"]) == 0
    said = capsys.readouterr().out
    assert "'pick' is a new task" in said
    assert "7 joints" in said
    assert "stored as e1: 2 keyframes" in said
    assert "info long-rest: The hand stands still for 9 s." in said


def test_record_and_throw_away(service, monkeypatch, tmp_path):
    assert run(monkeypatch, tmp_path, answers=["", "x", "q"]) == 0
    assert (kept(tmp_path), service.sent) == ([], [])


@pytest.fixture
def keys(monkeypatch):
    """Types at a terminal of its own."""
    person, terminal = pty.openpty()
    with os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield lambda typed: os.write(person, typed.encode())
    os.close(person)


def test_keys_move_the_gripper_while_it_records(keys, capsys):
    threading.Timer(0.4, keys, ["c"]).start()
    threading.Timer(0.8, keys, ["o"]).start()
    threading.Timer(1.2, keys, ["\n"]).start()
    trajectory = record_live(Arm(Plain(Body())), 50.0)
    assert trajectory.gripper_open[0]
    assert not trajectory.gripper_open.all()
    assert trajectory.gripper_open[-1]
    assert " Hz  hand +" in capsys.readouterr().err


def test_an_arm_that_cannot_be_guided_is_not_recorded_so(service, monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, "--guide", answers=["", "q"]) == 1
    assert "cannot be guided by its driver" in capsys.readouterr().err


def test_a_rate_out_of_range_is_refused_before_the_arm_is_opened(service, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(OPENED, None)
    assert run(monkeypatch, tmp_path, "--rate-hz", "1e4") == 1
    assert "rate_hz: is 10000 (valid: 20 to 1000)" in capsys.readouterr().err


def test_a_refused_recording_ends_with_1(service, monkeypatch, tmp_path, capsys):
    service.refuses = True
    assert run(monkeypatch, tmp_path, answers=["", "", "q"]) == 1
    assert "not stored: 422 Unprocessable: cube: no such object" in capsys.readouterr().out


def test_what_is_broken_off_is_never_sent(service, monkeypatch, tmp_path):
    assert run(monkeypatch, tmp_path, answers=["", KeyboardInterrupt()]) == 130
    assert (kept(tmp_path), service.sent) == ([], [])


def test_a_recording_that_the_service_did_not_take_is_sent_again(service, monkeypatch, tmp_path, capsys):
    service.away = True
    assert run(monkeypatch, tmp_path, answers=["", "", "q"]) == 1
    (folder,) = kept(tmp_path)
    assert f"send it again: roboprompt-robot record --upload {folder}" in capsys.readouterr().out
    again = ("record", "--upload", folder)
    assert type_command(monkeypatch, *again)[0] == 1
    service.away = False
    assert type_command(monkeypatch, *again)[0] == 0
    assert "stored as e1" in capsys.readouterr().out
    assert [key for key, _ in service.sent] == [folder.name]


def plain(address):
    return Plain(Body())


def test_a_cell_s_file(tmp_path):
    cell, body = tmp_path / "cell.json", Body()
    (tmp_path / "objects.json").write_text(json.dumps(OBJECTS))
    document = {
        "arm": f"{__name__}:plain",
        "options": {"address": "192.168.1.5"},
        "base_to_world": {"position": [0, 0, 0.5], "quaternion_xyzw": [0, 0, 0, 1]},
        "limits": {"workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]}},
        "objects": "objects.json",
        "tolerance": {"rotation_deg": 5},
        "open_width_m": 0.08,
    }
    cell.write_text(json.dumps(document))
    arm = open_robot(str(cell))
    assert arm.observe().objects[0].name == "cube"
    assert arm.state().position_m[2] == pytest.approx(body.position_m[2] + 0.5)
    for changes, field in (
        ({"arm": None}, "arm"),
        ({"arm": "nobody:Arm"}, "arm"),
        ({"speed": 1}, "speed"),
        ({"tolerance": {"speed": 1}}, "tolerance"),
        ({"options": {"port": 1}}, "options"),
        ({"base_to_world": {}}, "base_to_world"),
        ({"open_width_m": -1}, "open_width_m"),
    ):
        cell.write_text(json.dumps({**document, **changes}))
        with pytest.raises(InvalidInputError) as caught:
            open_robot(str(cell))
        assert caught.value.field == field


class OfOneself:
    """A robot with limits of its own."""

    def observe(self):
        return Observation()

    def execute(self, action):
        pass

    def stop(self):
        pass


def test_limits_are_not_lost_where_the_arm_is_a_robot(tmp_path):
    cell, arm = tmp_path / "cell.json", {"arm": f"{__name__}:OfOneself"}
    cell.write_text(json.dumps(arm))
    assert isinstance(open_robot(str(cell)), OfOneself)
    cell.write_text(json.dumps({**arm, "limits": {"workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]}}}))
    with pytest.raises(InvalidInputError, match="limits: is given, but `arm` returns a Robot"):
        open_robot(str(cell))


@pytest.mark.parametrize("command", ["look", "check"])
def test_an_arm_that_a_command_refuses_is_closed(tmp_path, monkeypatch, command):
    body = Body()
    monkeypatch.setattr(f"{__name__}.plain", lambda address: Plain(body))
    bound = {"tolerance": {"max_contact_force_n": 30}} if command == "check" else {}  # it reports no forces
    document = {"arm": f"{__name__}:plain", "options": {"address": "192.168.1.5"}, **bound}
    (tmp_path / "cell.json").write_text(json.dumps(document))
    assert type_command(monkeypatch, command, "--robot", tmp_path / "cell.json")[0] == 1
    assert body.closed


@pytest.mark.parametrize(("answers", "stored"), [(["y", "\n"], True), (["n"], False), ([""], False)])
def test_a_failed_run_is_corrected_by_showing_it(service, monkeypatch, tmp_path, capsys, answers, stored):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("builtins.input", lambda question: answers.pop(0))
    offer_correction(cli.RoboPromptClient("http://robots"), Arm(Plain(Body())), "pick", "pick it up", "p1")
    assert ("stored as e1" in capsys.readouterr().out) is stored
    assert [b'"corrects": "p1"' in body for _, body in service.sent] == [True] * stored
    assert (tmp_path / "recordings").exists() is stored


@pytest.mark.parametrize("may_move", ["y", "n"])
def test_a_recording_that_the_arm_broke_off_is_not_kept(service, monkeypatch, tmp_path, capsys, may_move):
    body = Body()
    monkeypatch.setattr(OPENED, lambda name: Arm(Plain(body)))

    def the_arm_fails():
        body.gone = True
        time.sleep(0.2)
        return "-"

    def it_was_looked_at():
        body.gone = False
        return may_move

    again = ["", "", "q"] if may_move == "y" else []
    assert run(monkeypatch, tmp_path, answers=["", the_arm_fails, it_was_looked_at, *again]) == 1
    assert len(service.sent) == len(kept(tmp_path)) == len(again[:1])
    assert "broken off, and not kept" in capsys.readouterr().out


def test_an_error_of_the_arm_stays_until_a_person_has_looked(monkeypatch, tmp_path):
    body = Body()
    body.fault = "a collision"
    monkeypatch.setattr(f"{__name__}.plain", lambda address: Plain(body))
    document = {"arm": f"{__name__}:plain", "options": {"address": "192.168.1.5"}}
    (tmp_path / "cell.json").write_text(json.dumps(document))
    command = ("recover", "--robot", tmp_path / "cell.json")
    assert type_command(monkeypatch, *command, answers=["n"])[0] == 1
    action = EndEffectorAction(body.position_m + 0.01, body.quaternion, True)
    with open_robot(str(tmp_path / "cell.json")) as arm, pytest.raises(MotionError, match="a collision"):
        arm.execute(action)
    assert type_command(monkeypatch, *command, answers=["y"])[0] == 0
    with open_robot(str(tmp_path / "cell.json")) as arm:
        arm.execute(action)


TURNED = Calibration(np.array([0.4, -0.2, 0.6]), about_z(np.pi))


@pytest.fixture
def with_base(service, monkeypatch):
    """A service whose tasks are `documents`, and an arm whose base is `TURNED`."""
    documents, put, plan = {"healthz": {"checks": {}}}, [], []

    def answer(request):
        name = request.url.path.rpartition("/")[2]
        if name == "plans":
            return httpx.Response(200, json={"steps": plan})
        if request.method == "PUT":
            put.append(json.loads(request.content))
            return httpx.Response(200, json={})
        if request.method == "GET" and name in documents:
            return httpx.Response(200, json=documents[name])
        return httpx.Response(404 if request.method == "GET" else 201, json=STORED)

    monkeypatch.setattr(cli, "RoboPromptClient", lambda url: client_of(answer))
    for opened in (OPENED, "roboprompt_client.cli.open_robot"):
        monkeypatch.setattr(opened, lambda name: Arm(Plain(Body()), calibration=TURNED))
    return SimpleNamespace(documents=documents, put=put, plan=plan)


def test_a_new_task_gets_the_base_of_the_cell(with_base, monkeypatch, tmp_path):
    assert run(monkeypatch, tmp_path, answers=["q"]) == 0
    assert with_base.put == [{"robot_base": [0.4, -0.2, 0.6], "robot_base_yaw_deg": 180.0}]


@pytest.mark.parametrize(
    ("base_m", "yaw_deg", "status"),
    [([0.4, -0.2, 0.0], 180, 0), ([0.41, -0.2, 0.6], -175, 0), ([0.4, -0.2, 0.6], 0, 1), ([0, 0, 0], 180, 1)],
)
@pytest.mark.parametrize("command", ["record", "run"])
def test_a_task_with_another_base_is_refused(
    with_base, command, base_m, yaw_deg, status, monkeypatch, tmp_path, capsys
):
    with_base.documents["pick"] = {"robot_base": base_m, "robot_base_yaw_deg": yaw_deg}
    if command == "record":
        assert run(monkeypatch, tmp_path, answers=["q"]) == status
    else:
        words = ["run", "--robot", "cell.json", "--task", "pick", "--instruction", "pick it up"]
        assert type_command(monkeypatch, *words)[0] == 1  # the rest of the task's document is missing
    assert ("base_to_world" in capsys.readouterr().err) == bool(status)
    assert with_base.put == []


def test_a_plan_with_a_task_with_another_base_is_refused(with_base, monkeypatch, capsys):
    with_base.documents["pick"] = {"robot_base": [0, 0, 0], "robot_base_yaw_deg": 0}
    with_base.plan.append({"task": "pick", "instruction": "pick it up"})
    words = ["run", "--robot", "cell.json", "--instruction", "pick it up", "--find", "cube"]
    assert type_command(monkeypatch, *words)[0] == 1
    assert "base_to_world" in capsys.readouterr().err


def test_a_run_of_an_unknown_task_makes_none(with_base, monkeypatch):
    type_command(monkeypatch, "run", "--robot", "cell.json", "--task", "pick", "--instruction", "pick it up")
    assert with_base.put == []
