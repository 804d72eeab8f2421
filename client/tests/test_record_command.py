"""What a person does at the arm: record, and send; and the cell's file."""

import json
import os
import pty
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from arms import client_of, type_command
from makers import Body, open_xarm, xarm

from roboprompt_client import cli
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.cell import open_robot
from roboprompt_client.commands.record import offer_correction
from roboprompt_client.commands.record_live import record_live
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import EndEffectorAction
from roboprompt_client.types.quaternions import about_z

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
        state.sent.append(request.content)
        return httpx.Response(201, json=STORED)

    monkeypatch.setattr(cli, "RoboPromptClient", lambda url: client_of(answer))
    monkeypatch.setattr("roboprompt_client.recording.spool.WAITS_S", ())
    opened = "roboprompt_client.commands.shared.open_robot"
    monkeypatch.setattr(opened, lambda name: Arm(open_xarm(Body(), monkeypatch)))
    (tmp_path / "objects.json").write_text(json.dumps(OBJECTS))
    return state


def run(monkeypatch, tmp_path, *more, answers=()):
    words = ["record", "--robot", "cell.json", "--task", "pick", "--instruction", "pick it up"]
    words += ["--objects", tmp_path / "objects.json", "--spool", tmp_path / "spool", *more]
    return type_command(monkeypatch, *words, answers=answers)[0]


def test_record_keep_and_upload(service, monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, answers=["", "", "q"]) == 0
    said = capsys.readouterr().out
    assert "'pick' is a new task" in said
    assert "7 joints" in said
    assert "stored as e1: 2 keyframes" in said
    assert "info long-rest: The hand stands still for 9 s." in said


def test_record_and_throw_away(service, monkeypatch, tmp_path):
    assert run(monkeypatch, tmp_path, answers=["", "x", "q"]) == 0
    assert list((tmp_path / "spool").iterdir()) == []


@pytest.fixture
def keys(monkeypatch):
    """Types at a terminal of its own."""
    person, terminal = pty.openpty()
    with os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield lambda typed: os.write(person, typed.encode())
    os.close(person)


def test_keys_move_the_gripper_while_it_records(keys, monkeypatch, tmp_path, capsys):
    body = Body()
    arm = Arm(open_xarm(body, monkeypatch))
    threading.Timer(0.4, keys, ["c"]).start()
    threading.Timer(0.8, keys, ["o"]).start()
    threading.Timer(1.2, keys, ["\n"]).start()
    trajectory = record_live(arm, tmp_path / "journal", 50.0, guide=False)
    assert trajectory.gripper_open[0]
    assert not trajectory.gripper_open.all()
    assert trajectory.gripper_open[-1]
    assert " Hz  hand +" in capsys.readouterr().err


def test_keys_steer_the_hand_while_it_records(keys, monkeypatch, tmp_path, capsys):
    body = Body()
    arm = Arm(open_xarm(body, monkeypatch), limits=MotionLimits(Box((-1, -1, 0), (body.position_m[0] + 0.06, 1, 2))))
    before_m = body.position_m
    for after_s, typed in ((0.3, "c"), (0.6, "f"), (0.9, "a"), (1.2, "w" * 3), (1.4, "w"), (1.5, "w"), (2.0, "\n")):
        threading.Timer(after_s, keys, [typed]).start()
    trajectory = record_live(arm, tmp_path / "journal", 50.0, teleop="keyboard")
    moved_m = trajectory.positions_m[-1] - before_m
    assert 0.002 < -moved_m[2] < 0.03  # a tap: this arm goes on for 0.15 s at every command
    assert 0.002 < moved_m[1] < 0.03
    assert 0.01 < moved_m[0] < 0.06  # held, up to the bound
    assert not trajectory.gripper_open[-1]
    assert "away, nearer" in capsys.readouterr().err


def test_a_hand_rests_after_the_last_key(keys, monkeypatch, tmp_path):
    """How long a key counts as held: `test_teleop`."""
    arm = Arm(open_xarm(Body(), monkeypatch))
    steered, moves = arm.steered, []

    @contextmanager
    def noting():
        def note(velocity, turning):
            moves.append(bool(velocity.any()))
            if not moves[-1]:
                keys("\n")
            return steer(velocity, turning)

        with steered() as steer:
            yield note

    monkeypatch.setattr(arm, "steered", noting)
    threading.Timer(0.5, keys, ["w"]).start()
    record_live(arm, tmp_path / "journal", 50.0, teleop="keyboard")
    assert len(moves) > 1
    assert moves == [*[True] * (len(moves) - 1), False]


@pytest.mark.parametrize(
    ("option", "why"),
    [
        (["--guide"], "cannot be guided by its driver"),
        (["--teleop", "keyboard"], "--teleop: standard input is not a terminal"),
        (["--teleop", "spacemouse"], "--teleop: no SpaceMouse is plugged in"),
    ],
)
def test_what_cannot_be_led_so_is_not_recorded(service, monkeypatch, tmp_path, capsys, option, why):
    monkeypatch.setattr("roboprompt_client.recording.teleop.HIDRAW", tmp_path)
    assert run(monkeypatch, tmp_path, *option, answers=["", "q"]) == 1
    assert why in capsys.readouterr().err
    assert list((tmp_path / "spool").iterdir()) == []


@pytest.mark.parametrize(("option", "valid"), [("--rate-hz", "20 to 1000"), ("--film-hz", "0 (no film) to 60")])
def test_a_rate_out_of_range_is_refused_before_the_arm_is_opened(service, monkeypatch, tmp_path, capsys, option, valid):
    monkeypatch.setattr("roboprompt_client.commands.shared.open_robot", None)
    with pytest.raises(SystemExit, match="2"):
        run(monkeypatch, tmp_path, option, "1e4")
    assert f"{option[2:].replace('-', '_')}: is 10000 (valid: {valid})" in capsys.readouterr().err


def test_a_refused_recording_ends_with_1(service, monkeypatch, tmp_path, capsys):
    service.refuses = True
    assert run(monkeypatch, tmp_path, answers=["", "", "q"]) == 1
    assert "refused: cube: no such object" in capsys.readouterr().out


def test_a_spool_that_cannot_be_made_is_said(service, monkeypatch, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert run(monkeypatch, tmp_path, "--spool", str(tmp_path / "file" / "spool")) == 1
    assert "--spool: " in capsys.readouterr().err


def test_an_interrupted_recording_is_sent_later(service, monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, answers=["", KeyboardInterrupt()]) == 130
    service.away = True
    assert run(monkeypatch, tmp_path, "--send-only") == 1
    assert "it waits in" in capsys.readouterr().out
    service.away = False
    assert run(monkeypatch, tmp_path, "--send-only") == 0
    assert "stored as e1" in capsys.readouterr().out


@pytest.fixture
def arm(monkeypatch):
    return Arm(open_xarm(Body(), monkeypatch))


def test_a_cell_s_file(tmp_path, monkeypatch):
    cell, body = tmp_path / "cell.json", Body()
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(body))
    (tmp_path / "objects.json").write_text(json.dumps(OBJECTS))
    document = {
        "arm": "xarm",
        "options": {"address": "192.168.1.5"},
        "base_to_world": {"position": [0, 0, 0.5], "quaternion_xyzw": [0, 0, 0, 1]},
        "limits": {"workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]}},
        "objects": "objects.json",
        "tolerance": {"rotation_deg": 5},
        "reach_m": 0.7,
    }
    cell.write_text(json.dumps(document))
    arm = open_robot(str(cell))
    assert arm.observe().objects[0].name == "cube"
    assert arm.state().position_m[2] == pytest.approx(body.position_m[2] + 0.5)
    far = EndEffectorAction(np.array([0.71, 0, 0.5]), np.array([1.0, 0, 0, 0]), True)
    assert arm.preview([far], MotionLimits())[0].warning == "the pose is out of reach: at most 0.7 m"
    for changes, field in (
        ({"arm": None}, "arm"),
        ({"arm": "nobody:Arm"}, "arm"),
        ({"speed": 1}, "speed"),
        ({"tolerance": {"speed": 1}}, "tolerance"),
        ({"options": {"port": 1}}, "options"),
        ({"base_to_world": {}}, "base_to_world"),
        ({"reach_m": -1}, "reach_m"),
        ({"urdf": "arm.urdf"}, "urdf"),
        ({"urdf": {"file": "none.urdf", "frame": "tool0"}}, "urdf"),
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


@pytest.mark.parametrize("commands", [["look"], ["viewpoints"], ["check"]])
def test_an_arm_that_a_command_refuses_is_closed(tmp_path, monkeypatch, commands):
    closed = []
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(Body()))
    monkeypatch.setattr("roboprompt_client.arms.xarm.XArm.close", lambda _: closed.append(None))
    bound = {"tolerance": {"max_contact_force_n": 30}} if commands == ["check"] else {}  # it reports no forces
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "xarm", "options": {"address": "192.168.1.5"}, **bound}))
    status, _ = type_command(monkeypatch, *commands, "--robot", tmp_path / "cell.json")
    assert (status, len(closed)) == (1, 1)


@pytest.mark.parametrize(("answers", "stored"), [(["y", "\n"], True), (["n"], False), ([""], False)])
def test_a_failed_run_is_corrected_by_showing_it(service, arm, monkeypatch, tmp_path, capsys, answers, stored):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("builtins.input", lambda question: answers.pop(0))
    offer_correction(cli.RoboPromptClient("http://robots"), arm, "pick", "pick it up", "p1")
    assert ("stored as e1" in capsys.readouterr().out) is stored
    assert [b'"corrects": "p1"' in body for body in service.sent] == [True] * stored
    assert (tmp_path / "recordings").exists() is stored


@pytest.mark.parametrize("may_move", ["y", "n"])
def test_a_recording_that_the_arm_interrupted_is_not_uploaded_by_the_way(
    service, monkeypatch, tmp_path, capsys, may_move
):
    body = Body()
    arm = Arm(open_xarm(body, monkeypatch))
    monkeypatch.setattr("roboprompt_client.commands.shared.open_robot", lambda name: arm)

    def the_arm_fails():
        body.gone = True
        time.sleep(0.2)
        return "-"

    def it_was_looked_at():
        body.gone = False
        return may_move

    again = ["", "", "q"] if may_move == "y" else []
    assert run(monkeypatch, tmp_path, answers=["", the_arm_fails, it_was_looked_at, *again]) == 1
    assert len(service.sent) == len(again[:1])
    said = capsys.readouterr().out
    assert "interrupted, and not uploaded: it is in" in said
    assert run(monkeypatch, tmp_path, "--send-only") == 0
    assert len(service.sent) == len(again[:1]) + 1


def test_an_error_of_the_arm_stays_until_a_person_has_looked(monkeypatch, tmp_path):
    body = Body()
    body.code = 31  # a collision
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(body))
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "xarm", "options": {"address": "192.168.1.5"}}))
    command = ("recover", "--robot", tmp_path / "cell.json")
    assert type_command(monkeypatch, *command, answers=["n"])[0] == 1
    with open_robot(str(tmp_path / "cell.json")) as arm:
        action = EndEffectorAction(body.position_m + 0.01, body.quaternion, True)
        with pytest.raises(MotionError, match=r"error 31: once a person has looked, .* roboprompt-robot recover"):
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
    opened = "roboprompt_client.commands.shared.open_robot"
    monkeypatch.setattr(opened, lambda name: Arm(open_xarm(Body(), monkeypatch), calibration=TURNED))
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
