"""From a cell's file and a mug on a table to the first executed prediction, by the commands of docs/camera.md."""

import json
import re

import numpy as np
import pytest

from roboprompt_client import RoboPromptClient, cli
from roboprompt_client.cell import open_robot
from tests.e2e.processes import running_server
from tests.e2e.walk_cell import BASE_POSITION_M, LAB, PLACES, RADIUS_M, TABLE_TOP_M

CELL = {
    "arm": "tests.e2e.walk_cell:arm",
    "base_to_world": {"position": BASE_POSITION_M, "quaternion_xyzw": [0, 0, 0, 1]},
    "limits": {"workspace": {"min": [-0.1, -0.4, TABLE_TOP_M], "max": [0.6, 0.4, 1.4]}},
}
TASK = ["--task", "mugs"]
INSTRUCTION = [*TASK, "--instruction", "lift the mug"]
SHOWN = ((0.15, 0.0, 0.0), (0.22, -0.12, 120.0), (0.12, 0.12, -110.0))
TAUGHT = ((0.20, 0.05, 20.0), (0.10, -0.12, -40.0), (0.27, 0.10, 60.0), (0.16, -0.02, 100.0))
ASKED = ((0.24, -0.06, -20.0), (0.13, 0.08, 45.0))
MIDDLE_M = 0.016  # of what is seen of the mug, from its axis towards its handle


class Lab:
    """A person at the terminal of the robot's computer."""

    def __init__(self, url, folder, monkeypatch, capsys):
        self.url, self.cell, self._monkeypatch, self._capsys = url, folder / "cell.json", monkeypatch, capsys
        self.folder = folder

    def run(self, *words, typed=(), status=0):
        """A command; returns what it prints.

        Args:
            typed: the lines that are typed into it; a callable is done before Enter is pressed.
        """
        lines = list(typed)

        def type_next(question):
            line = lines.pop(0)
            return (line() or "") if callable(line) else line

        self._monkeypatch.setattr("builtins.input", type_next)
        self._monkeypatch.setattr("sys.argv", ["roboprompt-robot", "--url", self.url, *map(str, words)])
        self._capsys.readouterr()
        ended = cli.main()
        printed = self._capsys.readouterr()
        assert ended == status, printed.out + printed.err
        assert not lines
        return printed.out


@pytest.fixture
def lab(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with running_server(tmp_path / "data", {"ROBOPROMPT_MAX_BODY_MB": "60"}) as url:
        yield Lab(url, tmp_path, monkeypatch, capsys)


def written_cell(lab):
    """What a calibration gives: poses that are a little off."""
    random = np.random.default_rng(3)
    cameras = []
    for name in PLACES:
        pose = LAB.camera(name).camera_to_world.copy()
        pose[:3, 3] += random.normal(0, 0.001, 3)
        options = {"name": name, "folder": str(lab.folder / name)}
        camera = {"name": name, "driver": "tests.e2e.walk_cell:camera", "options": options}
        cameras.append({**camera, "camera_to_world": pose.tolist()})
    lab.cell.write_text(json.dumps({**CELL, "cameras": cameras}))


def pixel_of_the_mug(camera):
    """Where a person clicks: on its wall, on the side of the camera."""
    seen_by, axis_m = LAB.camera(camera), LAB.task.position_m("mug")
    towards = (seen_by.camera_to_world[:3, 3] - axis_m) * (1, 1, 0)
    place_m = axis_m + RADIUS_M * towards / np.linalg.norm(towards) + (0, 0, 0.05)
    (pixel,), _ = seen_by.project([place_m])
    return pixel.round().tolist()


def guide():
    """The person moves the arm by hand."""
    LAB.perform(LAB.task.expert())


def teach_and_run(lab):
    """Demonstrations, and two predictions that are carried out."""
    of_cell = ["--robot", lab.cell]
    for place in TAUGHT:
        LAB.put(*place)
        said = lab.run(
            "record",
            *of_cell,
            *INSTRUCTION,
            "--rate-hz",
            "100",
            "--folder",
            lab.folder / "kept",
            typed=["", guide, "q"],
        )
        assert "stored as" in said, said
    for place in ASKED:
        LAB.put(*place)
        before_m = LAB.task.position_m("mug")
        answer = json.loads(lab.run("predict", *of_cell, *INSTRUCTION))
        (mug,) = answer["objects"]
        np.testing.assert_allclose(mug["position"][:2], before_m[:2], atol=MIDDLE_M + 0.006)
        said = lab.run("run", *of_cell, *INSTRUCTION, typed=["y", "y"])
        assert LAB.task.succeeded(), said


@pytest.mark.long
def test_from_an_empty_cell_to_the_first_motion(lab):
    written_cell(lab)
    of_cell = ["--robot", lab.cell]
    seen = lab.run("look", *of_cell, "--remember", "--html", lab.folder / "empty.html")
    assert re.search(r"front +640x480 +\d+% +0\.\d+ m +at 0\.75\d m, tilted by 0\.\d°", seen), seen

    with RoboPromptClient(lab.url) as client:
        client.configure_task("mugs", robot_base=BASE_POSITION_M)
        for place in SHOWN:
            LAB.put(*place)
            with open_robot(str(lab.cell)) as arm:
                client.label_object("mugs", "mug", frames=arm.frames(), clicks={"front": pixel_of_the_mug("front")})
        assert len(client.learn_from_labels("mugs", "mug")["model"]["views"]) == 3

    LAB.put(*TAUGHT[0])
    seen = lab.run("look", *of_cell, *TASK, "--html", lab.folder / "mug.html")
    assert re.search(r"mug +0\.\d\d\d ", seen), seen
    assert (lab.folder / "mug.html").read_text().count("<image") == 3

    teach_and_run(lab)
