"""README and docs say what the code does."""

import json
import re
from pathlib import Path

from app.api.schemas import examples
from app.llm.settings import LlmSettings
from app.settings import Settings

ROOT = Path(__file__).parents[1]


def test_every_setting_is_documented_and_nothing_else():
    documented = set(re.findall(r"^\| `ROBOPROMPT_(\w+)`", (ROOT / "docs/settings.md").read_text(), re.MULTILINE))
    assert documented == {name.upper() for name in Settings.model_fields}


def test_every_llm_setting_can_be_set():
    assert set(LlmSettings.__dataclass_fields__) <= set(Settings.model_fields)


def test_example_files_are_the_documented_examples():
    for name in ("EPISODE", "TASK", "PREDICT", "OUTCOME"):
        kept = json.loads((ROOT / f"docs/examples/{name.lower()}.json").read_text())
        assert kept == json.loads(json.dumps(getattr(examples, name)))


def test_no_package_registry_in_the_repository():
    locks = ("requirements.lock", "requirements-dev.lock", "docker/server.lock", "docker/build.lock")
    for path in (*locks, "pyproject.toml", "Makefile", ".ci/run", "benchmarks/metaworld/requirements.txt"):
        assert not re.search(r"https?://|index-url [^-]", (ROOT / path).read_text().replace("--no-emit-index-url", ""))
