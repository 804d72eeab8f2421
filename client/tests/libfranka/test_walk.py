"""docs/your-arm.md on a simulated Franka, by a person at a terminal: from an empty folder to a pushed button."""

import json
import os
import pty
import re
import select
import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.server import running_server
from app.sim.libfranka.demonstrate import ServedScene
from app.sim.tasks import make_task
from roboprompt_client.types.poses import object_json

PAGE = (Path(__file__).parents[3] / "docs/your-arm.md").read_text()
ADDRESS = "127.63.0.1"
BASE = "-0.3 0 0.752"
TAUGHT, ASKED = (0, 4, 8, 12), 16  # scenes, all with the red button asked for
NEAR_M, TAPS_M = 0.004, 0.03
PATIENCE_S = 180.0
SHOWN_CHARS = 2000  # of what was said before, where a test fails
MAX_LINES = 90
POSE = re.compile(r"hand ([+-]\d\.\d+) ([+-]\d\.\d+) ([+-]\d\.\d+) m")
AXES = ("ws", "ad", "rf")


def documented(beginning):
    """The one line of the page that begins so."""
    lines = [
        line.partition("  #")[0] for block in re.findall(r"```bash\n(.*?)```", PAGE, re.S) for line in block.split("\n")
    ]
    (found,) = {line.strip() for line in lines if line.startswith(beginning)}
    return found


class Person:
    """Types at a terminal, and reads it."""

    def __init__(self, folder, url):
        self._folder, self._url = folder, url
        self.lines, self.keys = [], 0

    def begin(self, line):
        """A command, as the page has it; its --url says where the test's service is."""
        self.lines.append(line)
        person, terminal = pty.openpty()
        _, *words = shlex.split(line)
        command = [sys.executable, "-m", "roboprompt_client", *words, "--url", self._url]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "COLUMNS": "200"}
        self._process = subprocess.Popen(
            command, stdin=terminal, stdout=terminal, stderr=terminal, cwd=self._folder, env=environment
        )
        os.close(terminal)
        self._terminal, self._seen, self.said, self._before = person, 0, "", ""

    def read(self, wait_s):
        """What has been printed since, at most after some time; False: the command has ended."""
        if not select.select([self._terminal], [], [], wait_s)[0]:
            return True
        try:
            self.said += os.read(self._terminal, 65536).decode()
        except OSError:
            return False
        return True

    def wait_for(self, text):
        end_s = time.monotonic() + PATIENCE_S
        while text not in self.said[self._seen :]:
            assert self.read(1.0), self._before + self.said
            assert time.monotonic() < end_s, f"no {text!r} in {self._before}{self.said}"
        self._seen = self.said.index(text, self._seen) + len(text)

    def answer(self, question, line=""):
        self.wait_for(question)
        self.lines.append(line)
        os.write(self._terminal, f"{line}\n".encode())

    def press(self, keys):
        self.keys += len(keys)
        os.write(self._terminal, keys.encode())

    def end(self, status=0):
        while self.read(PATIENCE_S):
            pass
        os.close(self._terminal)
        assert self._process.wait() == status, self.said
        return self.said

    def steer(self, goal_m):
        """With held keys, and with taps near the goal, by what the live line says."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            self._before, self.said, self._seen = (self._before + self.said)[-SHOWN_CHARS:], "", 0
            self.wait_for(" m")
            assert "Enter to record" not in self.said, self._before + self.said  # an error has ended the recording
            if not (poses := POSE.findall(self.said)):
                continue
            away_m = goal_m - np.array(poses[-1], float)
            if np.abs(away_m).max() < NEAR_M:
                return
            held = "".join(
                keys[int(value < 0)] for keys, value in zip(AXES, away_m, strict=True) if abs(value) >= NEAR_M
            )
            for _ in range(8 if np.abs(away_m).max() > TAPS_M else 1):
                self.press(held)
                time.sleep(0.03)
        raise AssertionError(self.said)


def written(folder, scene):
    """What a person measures with a ruler."""
    (folder / "objects.json").write_text(json.dumps([object_json(pose) for pose in scene.object_poses()]))
    return scene.position_m("red button")


def teach(person, seed, folder):
    """One demonstration, steered by keys."""
    button_m = written(folder, make_task("push_button", seed, 0))
    with ServedScene("push_button", seed, 0, ADDRESS) as scene:
        person.begin(documented("roboprompt-robot record --robot cell.json"))
        person.answer("Enter to record")
        person.wait_for("Enter: keep")
        person.press("c")
        for height_m in (0.08, -0.006, 0.08):
            person.steer(button_m + np.array([0.0, 0.0, height_m]))
            time.sleep(1.0)
        person.press("\n")
        person.wait_for("stored as")
        person.answer("Enter to record", "q")
        said = person.end()
        assert scene.judge() == "", said
    return said


@pytest.fixture
def person(tmp_path):
    with running_server(tmp_path / "data") as url:
        (tmp_path / "cell").mkdir()
        yield Person(tmp_path / "cell", url)


def test_from_an_empty_folder_to_a_right_motion(person, tmp_path, capsys):
    folder, began_s = tmp_path / "cell", time.monotonic()
    written(folder, make_task("push_button", TAUGHT[0], 0))
    person.lines.append("objects.json, by an editor")
    with ServedScene("push_button", TAUGHT[0], 0, ADDRESS):
        person.begin(documented("roboprompt-robot init"))
        person.answer("Which arm?", "franka")
        person.answer("Its address", ADDRESS)
        person.answer("Its model", "panda")
        person.answer("no real-time kernel", "y")
        person.answer("x y z, meters", BASE)
        person.answer("degrees", "0")
        person.answer("A file with the objects' poses", "objects.json")
        person.answer("Measure the space", "n")
        person.answer("May the gripper", "y")
        assert "written to cell.json" in person.end()

        person.begin(documented("roboprompt-robot check --robot cell.json --move"))
        person.answer("Is the space above it free?", "y")
        assert "FAIL" not in person.end()

    for seed in TAUGHT:
        person.lines.append("objects.json, by an editor")
        teach(person, seed, folder)

    person.lines.append("objects.json, by an editor")
    written(folder, make_task("push_button", ASKED, 0))
    with ServedScene("push_button", ASKED, 0, ADDRESS) as scene:
        person.begin(documented("roboprompt-robot predict --robot cell.json"))
        answer = json.loads(person.end())
        assert {finding["severity"] for finding in answer["findings"]} <= {"info", "warning"}, answer["findings"]
        person.begin(documented("roboprompt-robot run --robot cell.json"))
        for number in range(1, len(answer["actions"]) + 1):
            person.answer(f"action {number}:", "y")
        person.answer("Did it work?", "y")
        said = person.end()
        assert scene.judge() == "", said
    took_s = time.monotonic() - began_s
    with capsys.disabled():
        print(f"\n{len(person.lines)} lines and {person.keys} keys typed, {took_s:.0f} s")
    assert len(person.lines) <= MAX_LINES
