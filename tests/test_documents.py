"""README and docs say what the code does."""

import ast
import json
import re
from collections import defaultdict
from pathlib import Path

from app.api.schemas import examples
from app.pipeline.findings import SEVERITIES
from app.services.predict.findings import FAILURES
from app.settings import Settings

ROOT = Path(__file__).parents[1]


def test_every_setting_is_documented_and_nothing_else():
    documented = set(re.findall(r"^\| `ROBOPROMPT_(\w+)`", (ROOT / "docs/settings.md").read_text(), re.MULTILINE))
    assert documented == {name.upper() for name in Settings.model_fields}


def test_example_files_are_the_documented_examples():
    for name in ("EPISODE", "TASK", "PREDICT", "OUTCOME"):
        kept = json.loads((ROOT / f"docs/examples/{name.lower()}.json").read_text())
        assert kept == json.loads(json.dumps(getattr(examples, name)))


def test_no_package_registry_in_the_repository():
    locks = (
        "client/tests.txt",
        "client/libfranka/requirements.txt",
        "requirements.lock",
        "requirements-dev.lock",
        "docker/server.lock",
        "docker/build.lock",
    )
    for path in (
        *locks,
        "client/pyproject.toml",
        "pyproject.toml",
        "Makefile",
        ".ci/run",
        "benchmarks/metaworld/requirements.txt",
        "benchmarks/robosuite/requirements.txt",
    ):
        assert not re.search(r"https?://|index-url [^-]", (ROOT / path).read_text().replace("--no-emit-index-url", ""))


def _made_findings():
    """The severities by code of every `Finding(...)` in the code; all of them where a variable decides."""
    made = defaultdict(set, {code: {"danger"} for code, _, _ in FAILURES.values()})
    for path in (ROOT / "app").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                code, severity = node.args[:2]
                if isinstance(code, ast.Constant):
                    made[code.value] |= {severity.value} if isinstance(severity, ast.Constant) else set(SEVERITIES)
    return made


def test_every_finding_is_documented_with_its_severity_and_nothing_else():
    rows = re.findall(r"^\| `([\w-]+)` \| ([^|]+) \|", (ROOT / "docs/findings.md").read_text(), re.MULTILINE)
    documented = defaultdict(set)
    for code, severities in rows:
        documented[code] |= {severity for severity in SEVERITIES if severity in severities}
    made = _made_findings()
    assert documented.keys() == made.keys()
    for code, severities in documented.items():
        assert severities, code
        assert severities <= made[code], code
        assert severities == made[code] or made[code] == set(SEVERITIES), code
