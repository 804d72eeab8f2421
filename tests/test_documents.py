"""README and docs say what the code does."""

import ast
import json
import re
from collections import defaultdict
from pathlib import Path

from app.api.schemas import examples
from app.pipeline.findings import SEVERITIES
from app.pipeline.findings.rules import RULES
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
    ):
        assert not re.search(r"https?://|index-url [^-]", (ROOT / path).read_text().replace("--no-emit-index-url", ""))


def _made_findings():
    """The severities by code of every rule and `Finding(...)` in the code; all of them where a variable decides."""
    made = defaultdict(set)
    for rule in RULES:
        made[rule.code] |= set(rule.levels)
    for path in (ROOT / "app").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                code, severity = node.args[:2]
                if isinstance(code, ast.Constant) and isinstance(code.value, str):
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


def test_documented_thresholds_are_those_of_the_rules():
    rows = re.findall(r"^\| `([\w-]+)` \|(.+)", (ROOT / "docs/findings.md").read_text(), re.MULTILINE)
    said = dict(rows)
    for rule in RULES:
        for level in rule.levels.values():
            text = f"{100 * level:g} cm" if rule.unit == "m" else f"{level:g} {rule.unit}".strip()
            assert not rule.unit or text in said[rule.code], (rule.code, text)


def test_only_rules_decide_how_severe_a_doubt_about_an_answer_is():
    rooms = [*(ROOT / "app/services/predict").rglob("*.py"), *(ROOT / "app/pipeline/findings").rglob("*.py")]
    for path in rooms:
        if path.name not in ("rules.py", "recording.py"):
            made = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
            assert all(getattr(node.func, "id", "") != "Finding" for node in made), path
