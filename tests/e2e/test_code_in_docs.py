"""What README and docs show works as pasted: blocks of shell and Python are run in their order, page by page.

A comment before a block says why it is not run, one behind it what it prints:
`<!-- not run: it takes an hour -->`, `<!-- prints: "status":422; red button -->`.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(
    r"^(?:<!-- not run: (?P<reason>[^\n]+) -->\n)?^```(?P<language>bash|python)\n(?P<code>.*?)^```"
    r"(?:\n+<!-- prints: (?P<printed>[^\n]+) -->)?",
    re.MULTILINE | re.DOTALL,
)
README, DOCS = ROOT / "README.md", ROOT / "docs"
RESULTS = DOCS / "results"  # whose commands take hours
FIRST = [DOCS / f"guide/{name}.md" for name in ("running", "uploading", "predicting")]  # others ask for what they teach
PAGES = dict.fromkeys([README, *FIRST, *sorted(page for page in DOCS.rglob("*.md") if RESULTS not in page.parents)])
RUN = {page: [block for block in BLOCK.finditer(page.read_text()) if not block["reason"]] for page in PAGES}
ADDRESS = "http://127.0.0.1:8000"


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A folder to work in, with the examples."""
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(DOCS / "examples", folder / "docs/examples")
    return folder


@pytest.mark.parametrize("page", [page for page in PAGES if RUN[page]], ids=lambda page: page.stem)
def test_blocks_of_the_page_work_as_pasted(page, url, checkout):
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "ROBOPROMPT_URL": url}
    for block in RUN[page]:
        program = {"bash": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}[block["language"]]
        command = [*program, block["code"].replace(ADDRESS, url)]
        done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, timeout=300)
        said = done.stdout + done.stderr
        assert done.returncode == 0, block["code"] + said
        promised = (block["printed"] or "").split("; ")
        assert all(words in said for words in promised), (promised, said)
        assert ('"status":4' in said) == ('"status":422' in promised), said


def test_the_answer_of_readme_is_what_the_service_says(http):
    """Also its row, `1 A o: +0 +0 +20 0 36 36 0`: 10 cm above the button, the hand down, the gripper closed."""
    episode, question = (json.loads((DOCS / f"examples/{name}.json").read_text()) for name in ("episode", "predict"))
    episode["metadata"]["task"] = question["task"] = "press_of_readme"  # other tests may teach the examples' task more
    assert http.post("/episodes", json=episode).status_code == 201
    answer = http.post("/predict", json=question).json()
    (shown,) = (json.loads(block) for block in re.findall(r"^```json\n(.*?)^```", README.read_text(), re.M | re.S))
    for action, said in zip(answer["actions"], shown["actions"], strict=True):
        np.testing.assert_allclose(action["position"], said["position"], atol=1e-9)
        np.testing.assert_allclose(action["quaternion_xyzw"], said["quaternion_xyzw"], atol=1e-9)
        assert action["gripper_open"] is said["gripper_open"] is False
    assert answer["reply_text"] == shown["reply_text"]
    assert shown["reply_text"].startswith(" 1 A o: +0 +0 +20 0 36 36 0;")
    above_m = np.subtract(answer["actions"][0]["position"], answer["objects"][0]["position"])
    np.testing.assert_allclose(above_m, [0, 0, 20 * 0.005], atol=1e-9)
    assert [{name: item[name] for name in shown["findings"][0]} for item in answer["findings"]] == shown["findings"]
