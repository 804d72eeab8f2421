"""What is installed is installed by hash; the bill of materials says what that is."""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from roboprompt_client.version import VERSION

ROOT = Path(__file__).parents[1]
CLIENT = tomllib.loads((ROOT / "client/pyproject.toml").read_text())["project"]
PINNED = re.compile(r"^([\w.-]+)(?:\[[^\]]*\])?==([^\s;\\]+)", re.MULTILINE)


def commands(path):
    """The file's shell commands, one a line."""
    text = re.sub(r"\\\n\s*", " ", (ROOT / path).read_text())
    return [part.strip() for part in re.split(r"&&|\n", text)]


@pytest.mark.parametrize("path", ["docker/Dockerfile", "docker/compose.yaml", "Makefile", ".ci/run"])
def test_pip_takes_nothing_without_its_hash(path):
    """Or it takes our own wheels or folder alone."""
    for command in commands(path):
        if re.search(r"\bpip\b.* install\b", command):
            ours = "--no-deps" in command and re.search(r"( \.| \./client| /dist/roboprompt\*\.whl)$", command)
            assert "--require-hashes" in command or ours, command


def test_there_is_something_to_look_at():
    found = [command for path in ("docker/Dockerfile", "Makefile") for command in commands(path)]
    assert sum("--require-hashes" in command for command in found) == 6


def versions(path):
    return dict(PINNED.findall((ROOT / path).read_text()))


@pytest.mark.parametrize("path", ["requirements.lock", "docker/server.lock", "docker/build.lock"])
def test_every_lock_has_the_versions_that_are_tested(path):
    tested, locked = versions("requirements-dev.lock"), versions(path)
    assert locked
    assert {name: tested.get(name) for name in locked} == locked


def test_what_is_installed_beside_the_lock_changes_nothing_of_it():
    tested, beside = versions("requirements-dev.lock"), versions("client/tests/libfranka/requirements.txt")
    assert {"mujoco", "numpy"} <= set(beside) & set(tested)
    assert {name: tested.get(name, beside[name]) for name in beside} == beside


@pytest.mark.parametrize("world", ["fetch", "libero", "metaworld", "robosuite"])
def test_another_world_s_environment_has_what_the_robot_s_side_needs(world):
    needed = {re.split(r"[^\w.-]", requirement)[0] for requirement in CLIENT["dependencies"]}
    assert needed <= set(versions(f"benchmarks/{world}/requirements.txt"))


def test_every_pinned_package_has_a_hash():
    for path in ("docker/server.lock", "docker/build.lock"):
        for block in re.split(r"\n(?=\S)", (ROOT / path).read_text().strip()):
            assert "--hash=sha256:" in block, block


def test_the_base_image_is_an_argument():
    stages = [line for line in (ROOT / "docker/Dockerfile").read_text().splitlines() if line.startswith("FROM")]
    assert stages == ["FROM ${PYTHON_IMAGE} AS build", "FROM ${PYTHON_IMAGE}"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, ROOT / ".ci/dist", "--to", folder], check=True, capture_output=True)
    return folder


def test_the_bill_lists_what_the_image_installs(made):
    text = (made / "roboprompt.cdx.json").read_text()
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    bill = json.loads(text)
    installed = {item["name"]: item["version"] for item in bill["components"]}
    assert installed.pop("roboprompt-client") == VERSION
    assert installed == versions("docker/server.lock")
    assert all(item["hashes"] for item in bill["components"])


def test_the_provenance_names_the_wheels_and_the_commit(made):
    statement = json.loads((made / "roboprompt.provenance.json").read_text())
    assert [subject["name"].split("-")[0] for subject in statement["subject"]] == ["roboprompt", "roboprompt_client"]
    for subject in statement["subject"]:
        assert subject["digest"]["sha256"] == hashlib.sha256((made / subject["name"]).read_bytes()).hexdigest()
    materials = {
        item["uri"]: item["digest"] for item in statement["predicate"]["buildDefinition"]["resolvedDependencies"]
    }
    assert ("git+file:." in materials) == (ROOT / ".git").exists()
    lock = {"digest": materials["file:docker/server.lock"]}
    assert lock["digest"]["sha256"] == hashlib.sha256((ROOT / "docker/server.lock").read_bytes()).hexdigest()
