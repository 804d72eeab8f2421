"""`roboprompt-robot` as a person at the robot's computer uses it."""

import json
import re
import shlex
import sys
from contextlib import nullcontext
from pathlib import Path

import httpx
import pytest
from arms import client_of, type_command

from roboprompt_client import cli

ACTION = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": True}
BOUNDS = {"keep_out": [], "max_step_m": None, "max_step_rotation_deg": None}
LIMITS = {"object_names": ["cube"], "workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]}, "motion_limits": BOUNDS}
MY_CELL = """
from roboprompt_client import Observation, ObjectPose

class Fake:
    def observe(self):
        return Observation(ObjectPose("cube", [0, 0, 0]))

    def execute(self, action):
        pass

    def stop(self):
        pass

def make():
    return Fake()
"""


class Service:
    """A service that has one prediction, and records what it is sent."""

    def __init__(self):
        self.urls, self.outcomes, self.down, self.findings = [], [], False, []

    def __call__(self, request):
        path = request.url.path
        if path == "/healthz":
            return httpx.Response(200, json={"checks": {}})
        if path == "/tasks/pick":
            return httpx.Response(200, json=LIMITS)
        if path == "/plans":
            steps = [{"task": "pick", "instruction": "pick up the cube"}] * 2
            return httpx.Response(200, json={"steps": steps})
        if path == "/predict":
            return httpx.Response(200, json={"id": "p1", "actions": [ACTION], "findings": self.findings})
        if self.down:
            raise httpx.ConnectError("refused")
        self.outcomes.append((path, json.loads(request.read())))
        return httpx.Response(200, json={})

    def client(self, url):
        self.urls.append(url)
        return client_of(self)


@pytest.fixture
def service(monkeypatch, tmp_path):
    service = Service()
    monkeypatch.setattr(cli, "RoboPromptClient", service.client)
    monkeypatch.setattr("sys.path", ["/"])
    monkeypatch.delitem(sys.modules, "my_cell", raising=False)
    (tmp_path / "my_cell.py").write_text(MY_CELL)
    monkeypatch.chdir(tmp_path)
    return service


RUN = ("run", "--robot", "my_cell:make", "--task", "pick", "--instruction", "pick up the cube", "--yes")


@pytest.mark.parametrize(
    "words", [("--url", "http://robot-lab:8000", *RUN), (*RUN, "--url", "http://robot-lab:8000"), RUN]
)
def test_a_factory_in_the_current_folder_runs_at_the_url_or_this_machine(service, monkeypatch, capsys, words):
    assert type_command(monkeypatch, *words)[0] == 0
    assert service.urls == ["http://robot-lab:8000" if "--url" in words else "http://127.0.0.1:8000"]
    assert json.loads(capsys.readouterr().out)["id"] == "p1"


@pytest.mark.parametrize(
    ("answers", "recorded"),
    [
        (["y"], {"success": True, "note": None}),
        (["Yes, but slowly"], {"success": True, "note": "but slowly"}),
        (["n"], {"success": False, "note": None}),
        (["n: the cube slipped"], {"success": False, "note": "the cube slipped"}),
        (["perhaps", "n it fell"], {"success": False, "note": "it fell"}),
    ],
)
def test_after_a_run_the_person_says_whether_it_worked(service, monkeypatch, answers, recorded):
    status, asked = type_command(monkeypatch, *RUN, answers=answers)
    assert (status, len(asked)) == (int(not recorded["success"]), len(answers))
    assert service.outcomes == [("/predictions/p1/outcome", recorded)]


@pytest.mark.parametrize("answers", [[""], []])
def test_without_an_answer_no_outcome_is_recorded(service, monkeypatch, answers):
    status, asked = type_command(monkeypatch, *RUN, answers=answers)
    assert (status, len(asked), service.outcomes) == (0, 1, [])


def test_an_outcome_that_cannot_be_recorded_is_logged(service, monkeypatch, caplog):
    service.down = True
    assert type_command(monkeypatch, *RUN, answers=["y"])[0] == 0
    assert "the outcome was not recorded: POST http://robots/predictions/p1/outcome: refused" in caplog.text


PLAN = ("run", "--robot", "my_cell:make", "--instruction", "pick up the cube twice")


def test_without_a_task_the_steps_of_the_instruction_are_carried_out(service, monkeypatch, capsys):
    assert type_command(monkeypatch, *PLAN, "--yes") == (0, [])
    assert [step["id"] for step in json.loads(capsys.readouterr().out)["steps"]] == ["p1", "p1"]


@pytest.mark.parametrize(
    ("answers", "status", "outcomes"),
    [
        (["y", "y", "y", "y", "y"], 0, [True, True]),
        (["n"], 1, []),
        (["y", "n"], 1, []),
        (["y", "y", "n"], 1, [False]),
        (["y", "y", ""], 1, []),
    ],
)
def test_a_person_is_asked_about_the_plan_each_action_and_each_outcome(service, monkeypatch, answers, status, outcomes):
    assert type_command(monkeypatch, *PLAN, "--confirm", answers=answers)[0] == status
    assert [document["success"] for _, document in service.outcomes] == outcomes


@pytest.mark.parametrize(
    ("option", "question"), [(["--confirm"], "action 1: to 0.100 0.200 0.900 m"), ([], "Carry out 1 action(s)?")]
)
def test_a_run_asks_before_its_first_motion(service, monkeypatch, option, question):
    status, (asked,) = type_command(monkeypatch, *RUN[:-1], *option, answers=["no"])
    assert (status, asked.startswith(question), service.outcomes) == (1, True, [])


@pytest.mark.parametrize(("option", "others"), [([], ["y"]), (["--yes"], []), (["--confirm"], ["y"])])
def test_a_danger_is_asked_about_as_such_once_and_yes_does_not_answer_it(service, monkeypatch, option, others):
    service.findings = [{"code": "object-tilted", "severity": "danger", "message": "The cube is tilted by 90 degrees."}]
    danger = "DANGER: The cube is tilted by 90 degrees. Carry out anyway? [y/N] "
    assert type_command(monkeypatch, *RUN[:-1], *option, answers=["n"]) == (1, [danger])
    status, asked = type_command(monkeypatch, *RUN[:-1], *option, answers=["y", *others, "y"])
    assert (status, asked[0], asked.count(danger), len(asked)) == (0, danger, 1, len(others) + 2)


def test_a_file_that_is_not_there_is_named(service, monkeypatch, capsys):
    words = ("predict", "--task", "pick", "--instruction", "pick", "--objects", "none.json")
    assert type_command(monkeypatch, *words)[0] == 1
    assert "--objects: none.json cannot be read" in capsys.readouterr().err


ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(?:bash)?\n(.*?)^```", re.MULTILINE | re.DOTALL)
DOCUMENTED = sorted(
    {
        line.strip().removeprefix(".venv/bin/")
        for page in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("client/*.md"))
        for block in BLOCK.findall(page.read_text())
        for line in block.replace("\\\n", " ").splitlines()
        if re.match(r"\s*(?:\.venv/bin/)?roboprompt-robot ", line)
    }
)


@pytest.mark.parametrize("line", DOCUMENTED)
def test_every_command_of_the_docs_can_be_typed(line):
    _, *words = shlex.split(line, comments=True)
    with pytest.raises(SystemExit) if words == ["--help"] else nullcontext():
        cli._parser().parse_args(words)
