"""README's examples work as pasted, against the running service."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
CURL = [block for block in re.findall(r"```bash\n(.*?)```", README, re.DOTALL) if "curl" in block]
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
ADDRESS = "http://127.0.0.1:8000"


def run(command, url):
    pasted = [part.replace(ADDRESS, url) for part in command]
    return subprocess.run(pasted, cwd=ROOT, capture_output=True, text=True, timeout=120, check=True).stdout


def test_curl_examples_in_their_order(url):
    answers = [run(["bash", "-ec", block], url) for block in CURL]
    assert '"actions_text"' in answers[0]
    assert '"actions"' in answers[1]
    assert '"outcome":{"success":true' in answers[1]
    assert all(f'"{name}"' in answers[2] for name in ("episodes", "version", "predictions", "models", "checks"))
    assert '"status":422' in answers[3]
    assert "blue button" in answers[3]


@pytest.mark.parametrize("block", PYTHON)
def test_python_example(url, block):
    lines = run([sys.executable, "-c", block], url).splitlines()
    assert len(lines) == 3
