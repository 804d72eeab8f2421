"""README and docs say what the code does."""

import json
import os
import re
from fnmatch import fnmatch
from pathlib import Path

import pytest
import typer

from app import cli
from app.api.schemas import examples
from app.pipeline.finding import LEVELS
from app.settings import Settings
from roboprompt_client.types.severity import SEVERITIES

ROOT = Path(__file__).parents[1]


def test_every_setting_is_documented_and_nothing_else():
    documented = set(re.findall(r"^\| `ROBOPROMPT_(\w+)`", (ROOT / "docs/settings.md").read_text(), re.MULTILINE))
    assert documented == {name.upper() for name in Settings.model_fields}


def test_example_files_are_the_documented_examples():
    for name in ("EPISODE", "TASK", "PREDICT", "PLAN", "OUTCOME"):
        kept = json.loads((ROOT / f"docs/examples/{name.lower()}.json").read_text())
        assert kept == json.loads(json.dumps(getattr(examples, name)))


@pytest.mark.parametrize("path", sorted((ROOT / "docs/examples").glob("*.py")), ids=lambda path: path.stem)
def test_example_programs_are_python(path):
    compile(path.read_text(), path, "exec")


def test_no_package_registry_in_the_repository():
    locks = (
        "client/tests/libfranka/requirements.txt",
        "client/tests/realsense/requirements.txt",
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


def test_every_finding_is_documented_with_its_severities_and_nothing_else():
    rows = re.findall(r"^\| `([\w-]+)` \| ([^|]+) \|", (ROOT / "docs/findings.md").read_text(), re.MULTILINE)
    documented = {code: {severity for severity in SEVERITIES if severity in said} for code, said in rows}
    assert documented.keys() == LEVELS.keys()
    for code, levels in LEVELS.items():
        may_be = {"warning": levels.warning > levels.danger, "danger": levels.danger >= 0}
        assert documented[code] - {"info"} == {severity for severity, can in may_be.items() if can}, code


PAGES = [
    *(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "SECURITY.md", "client/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
FOLDERS = ("app", "client", "benchmarks", "docker", "docs", "migrations", "openapi", "tests")
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _name(page):
    return str(page.relative_to(ROOT))


def _prose(page):
    """The page without its blocks of code."""
    return BLOCK.sub("", page.read_text())


def _slug(heading):
    """The anchor that GitHub makes of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_every_relative_link_leads_to_a_file_and_a_heading(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", _prose(page)):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = page.parent / path if path else page
        assert file.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.+)$", file.read_text(), re.MULTILINE)
            assert anchor in map(_slug, headings), target


def test_the_site_leads_to_every_page():
    """Results are reached from their list."""
    listed = (ROOT / "properdocs.yml").read_text()
    pages = {page.relative_to(ROOT / "docs").as_posix() for page in (ROOT / "docs").rglob("*.md")}
    assert not {page for page in pages if not page.startswith("results/") and f": {page}\n" not in listed}


def _files():
    for name in FOLDERS:
        for folder, below, files in os.walk(ROOT / name):
            below[:] = [item for item in below if item not in (".venv", "__pycache__")]
            yield from ((Path(folder) / file).relative_to(ROOT).as_posix() for file in files)


FILES = list(_files())


def _exists(named):
    """Whether a path from the root or the end of one, or a module with or without a name of it, is there."""
    if named.endswith(".py"):
        return any(fnmatch(f"/{path}", f"*/{named}") for path in FILES)
    if "/" in named:
        return bool(list(ROOT.glob(named.rstrip("/"))) or list(ROOT.glob(f"{named}.py")))
    parts = named.split(".")
    root = ROOT / "client" if parts[0] == "roboprompt_client" else ROOT
    module, holder = root.joinpath(*parts), root.joinpath(*parts[:-1])
    if module.is_dir() or module.with_suffix(".py").is_file():
        return True
    texts = [path.read_text() for path in (holder / "__init__.py", holder.with_suffix(".py")) if path.is_file()]
    return any(re.search(rf"\b{parts[-1]}\b", text) for text in texts)


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_every_named_file_and_module_is_there(page):
    rooted = rf"(?:{'|'.join(FOLDERS)})/[\w./*-]+"
    dotted = r"(?:app|benchmarks|roboprompt_client)(?:\.\w+)+"
    named = re.findall(rf"`({rooted}|{dotted}|[\w/]+\.py)[`:]", _prose(page))
    missing = [name for name in named if not _exists(name) and ".venv" not in name]
    assert not missing


def test_the_map_of_architecture_names_what_is_there():
    """Each folder of the map is one, and each folder of the server stands in it."""
    drawn = BLOCK.search((ROOT / "ARCHITECTURE.md").read_text())[2]
    folders = set(re.findall(r"\b([a-z]\w+)/", drawn))
    there = {part for path in FILES for part in path.split("/")[:-1]}
    assert folders <= there
    assert {path.parent.name for path in (ROOT / "app").glob("*/__init__.py")} <= folders


def _lines_of_shell(page):
    """The commands of the page, in its blocks and in its sentences; continued lines joined, comments left out."""
    yield from (text.replace("\n", " ") for text in re.findall(r"`(roboprompt [^`]+)`", _prose(page)))
    for language, block in BLOCK.findall(page.read_text()):
        if language in ("bash", "sh", ""):
            for line in block.replace("\\\n", " ").splitlines():
                yield line.partition(" #")[0].strip().removeprefix(".venv/bin/")


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_every_command_has_its_name_and_options(page):
    known = typer.main.get_command(cli.application)
    known.commands = {name: cli.load(name) for name in cli.COMMANDS}
    for line in _lines_of_shell(page):
        program, *words = line.split() if line else ("",)
        while re.match(r"[A-Z_]+=", program) and words:
            program, *words = words
            program = program.removeprefix(".venv/bin/")
        if program != "roboprompt":
            continue
        command = known
        while hasattr(command, "commands") and words and not words[0].startswith("-"):
            assert words[0] in command.commands, line
            command = command.commands[words.pop(0)]
        options = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
        used = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert used <= options | {"--help"}, line


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_every_target_of_make_is_there(page):
    text = page.read_text()
    named = set(re.findall(r"`make ([a-z]+)", text))
    named |= {line.split()[1] for line in _lines_of_shell(page) if re.match(r"make [a-z]", line)}
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert named <= targets


@pytest.mark.parametrize(("page", "unit", "most"), [("README.md", "words", 900), ("ARCHITECTURE.md", "lines", 150)])
def test_pages_stay_short(page, unit, most):
    text = (ROOT / page).read_text()
    assert len(text.split() if unit == "words" else text.splitlines()) <= most


def test_decisions_have_at_most_five_lines():
    decisions = (ROOT / "ARCHITECTURE.md").read_text().partition("## Decisions")[2]
    for decision in re.split(r"^(?:- |#)", decisions, flags=re.MULTILINE):
        lines = decision.strip().splitlines()
        assert len(lines) <= 5, decision
        assert all(len(line) <= 120 for line in lines), decision


def test_what_the_makefile_tests_is_there():
    named = re.findall(r"\b(?:client/)?tests/[\w/.]+", (ROOT / "Makefile").read_text())
    assert [path for path in named if not (ROOT / path).exists() and "__pycache__" not in path] == []
