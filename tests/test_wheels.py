"""What users install: the two wheels, in an environment that has nothing but what they declare."""

import json
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from contextlib import contextmanager
from importlib.metadata import Distribution, distribution
from pathlib import Path

import httpx
import pytest
from packaging.requirements import Requirement

from app.evaluation.server import free_port
from roboprompt_client.version import VERSION
from tests.e2e.processes import wait_until_alive

ROOT = Path(__file__).parents[1]
OURS = {"roboprompt", "roboprompt-client"}


def build(source, folder):
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1800000000"}
    subprocess.run([sys.executable, source / ".ci/dist", "--to", folder], check=True, env=environment)
    return sorted(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    return build(ROOT, tmp_path_factory.mktemp("dist"))


def declared(requirements, extras, found):
    """Adds the distributions to `found` that the requirements ask for, and those that these ask for in turn."""
    for requirement in map(Requirement, requirements):
        if requirement.name in OURS or not wanted(requirement, extras):
            continue
        there = distribution(requirement.name)
        assert requirement.specifier.contains(there.version), requirement
        if (there.name, *requirement.extras) not in found:
            found[there.name, *requirement.extras] = there
            declared(there.requires or (), requirement.extras, found)
    return found


def wanted(requirement, extras):
    return not requirement.marker or any(requirement.marker.evaluate({"extra": extra}) for extra in ("", *extras))


def required_client(wheel):
    text = zipfile.ZipFile(wheel).read(f"roboprompt-{VERSION}.dist-info/METADATA").decode()
    return re.findall("^Requires-Dist: roboprompt-client(.*)", text, re.MULTILINE)


def test_the_service_requires_the_client_of_its_version(wheels):
    assert required_client(wheels[0]) == [f"=={VERSION}"]


def test_pip_takes_the_client_of_a_checkout_from_its_folder(tmp_path):
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    subprocess.run([*command, tmp_path, ROOT], check=True)
    assert required_client(next(tmp_path.glob("*.whl"))) == [f" @ {(ROOT / 'client').as_uri()}"]


class Environment:
    """A virtual environment with the wheels. The packages that they need are linked from the one of the tests: what
    matters is which they are."""

    def __init__(self, folder, wheels):
        venv.create(folder, with_pip=False)
        self.python = folder / "bin/python"
        self.packages = next(folder.glob("lib/python*/site-packages"))
        command = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--no-index", "--no-deps", "--python"]
        subprocess.run([*command, self.python, *wheels], check=True)
        self.add()

    def add(self, *extras):
        for metadata in self.packages.glob("roboprompt*.dist-info"):
            for found in declared(Distribution.at(metadata).requires, extras, {}).values():
                for name in {file.parts[0] for file in found.files} - {"..", "__pycache__"}:
                    if not (self.packages / name).exists():
                        (self.packages / name).symlink_to(found.locate_file(name))

    def run(self, *arguments, **options):
        """`roboprompt` with the arguments."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        command = [self.python.with_name("roboprompt"), *arguments]
        return subprocess.Popen(command, env=environment, text=True, **options)

    def output(self, *arguments, cwd):
        with self.run(*arguments, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            said, _ = process.communicate(timeout=300)
        return process.returncode, said

    @contextmanager
    def service(self, cwd):
        port = free_port()
        url = f"http://127.0.0.1:{port}"
        with self.run("serve", "--port", str(port), cwd=cwd, stderr=subprocess.DEVNULL) as process:
            try:
                wait_until_alive(process, url)
                with httpx.Client(base_url=url, timeout=120) as http:
                    yield http
            finally:
                process.terminate()


@pytest.fixture(scope="module")
def environment(wheels, tmp_path_factory):
    return Environment(tmp_path_factory.mktemp("environment") / "venv", wheels)


@pytest.fixture
def elsewhere(tmp_path):
    """A folder with packages of the same names, as many projects have."""
    for name in ("app", "migrations"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('this is not RoboPrompt')")
    return tmp_path


def test_the_version_is_that_of_the_source(environment, elsewhere):
    assert environment.output("--version", cwd=elsewhere) == (0, f"roboprompt {VERSION}\n")
    client, server = (Distribution.at(path) for path in sorted(environment.packages.glob("roboprompt*.dist-info")))
    assert (client.version, server.version) == (VERSION, VERSION)


def test_the_service_answers_from_any_folder(environment, elsewhere):
    with environment.service(elsewhere) as http:
        for page in ("/ui/tasks", "/docs", "/docs/guide/", "/docs/guide/reference/client.html"):
            assert http.get(page, follow_redirects=True).status_code == 200, page
        for name, address in (("episode", "/episodes"), ("predict", "/predict")):
            example = http.get(f"/docs/guide/examples/{name}.json").json()
            assert http.post(address, json=example).status_code in (200, 201), name


def test_a_command_whose_extra_is_missing_names_it(environment, elsewhere):
    status, said = environment.output("demo", cwd=elsewhere)
    assert status == 1
    assert said.strip().endswith("pip install 'roboprompt[sim]'")


def test_the_demo_runs_from_any_folder(environment, elsewhere):
    environment.add("sim")
    options = ("--task", "push_button", "--demos", "2", "--episodes", "1", "--no-compare", "--json")
    status, said = environment.output("demo", *options, cwd=elsewhere)
    assert status == 0, said
    figures = json.loads(said.splitlines()[-1])
    assert (elsewhere / figures["data"]).is_dir()


def test_the_same_source_gives_the_same_bytes_in_another_folder(wheels, tmp_path):
    for name in ("app", "client", "migrations", "docker", ".ci"):
        left_out = shutil.ignore_patterns(".venv", "__pycache__")
        shutil.copytree(ROOT / name, tmp_path / name, copy_function=shutil.copyfile, ignore=left_out)
    for path in ROOT.glob("[A-Zhpr]*"):
        if path.is_file():
            shutil.copyfile(path, tmp_path / path.name)
    again = build(tmp_path, tmp_path / "dist")
    assert [wheel.read_bytes() for wheel in again] == [wheel.read_bytes() for wheel in wheels]
