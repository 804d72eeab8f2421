"""`roboprompt doctor`: what is missing or wrong on this machine, and how to repair it."""

import os
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import typer
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from pydantic import ValidationError
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError

from app.cli.shared import DOT_ENV, Data, EnvFile, is_installed, packages_of_extras
from app.llm.llama.weights import find_weights
from app.llm.llm_settings import ENV_PREFIX
from app.llm.registry import ModelRegistry
from app.settings import Settings, load_env_file
from app.store.data_folder import OTHERS, require_ours
from app.store.database import Database, is_newest
from app.store.tables import metadata
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.version import VERSION

PATIENCE_S = 60.0
RENDERS = "import sys; from app.sim.rendering import opengl_works; sys.exit(not opengl_works())"
COLORS = {"ok": "green", "missing": "yellow", "wrong": "yellow"}
CLIENTS_OWN = {"api_key"}  # read by roboprompt-client
LIBRARY = "import xllamacpp"
WHAT_FOR = {
    "sim": "roboprompt demo, eval",
    "datasets": "imports of LeRobot, robomimic",
    "video": "videos of LeRobot datasets",
    "postgres": "ROBOPROMPT_DATABASE_URL=postgresql://...",
    "s3": "ROBOPROMPT_BLOBS_URL",
}


@dataclass(frozen=True)
class Probe:
    """The result of one check.

    Attributes:
        remedy: what to do where it is not ok.
        required: whether `roboprompt serve` needs it.
    """

    name: str
    state: Literal["ok", "missing", "wrong"]
    seen: str
    remedy: str = ""
    required: bool = True


def doctor(
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Check what RoboPrompt needs on this machine; nothing is changed but the cache of weights.

    The exit status is 1 where something fails that `roboprompt serve` needs.
    """
    if env_file is not None:
        load_env_file(env_file)
    console = Console()
    python = ".".join(map(str, sys.version_info[:3]))
    console.print(f"RoboPrompt {VERSION}, Python {python}, {sys.platform}", highlight=False)
    table = Table("", "needed", "state", "what was seen, and what to do", box=None, pad_edge=False)
    for column in table.columns:
        column.overflow = "fold"
    failed = 0
    for found in check(data):
        fails = found.required and found.state != "ok"
        failed += fails
        color = "red" if fails else COLORS[found.state]
        said = found.seen if found.state == "ok" else f"{found.seen}\n-> {found.remedy}"
        needed = "yes" if found.required else "no"
        table.add_row(escape(found.name), needed, f"[{color}]{found.state}[/]", escape(said))
    console.print(table)
    if DOT_ENV.is_file() and env_file is None:
        console.print("The file .env in this folder is not read: if it is yours, say --env-file .env")
    if failed:
        console.print(f"{failed} needed {'thing is' if failed == 1 else 'things are'} missing or wrong.")
        raise typer.Exit(1)


def check(data: Path | None) -> Iterator[Probe]:
    """Check settings, LLM, store, extras and OpenGL; if the settings are wrong, the others with default settings."""
    try:
        settings = Settings() if data is None else Settings(data=data)
    except ValidationError as error:
        settings = Settings.model_construct() if data is None else Settings.model_construct(data=data)
        for wrong in error.errors():
            variable = ENV_PREFIX + "_".join(map(str, wrong["loc"][:1])).upper()
            yield Probe(variable, "wrong", f"{wrong['input']!r}: {wrong['msg']}", "see docs/settings.md")
    yield from misspelled(os.environ)
    if settings.default_model.startswith("embedded/"):
        yield library(LIBRARY)
    yield model(settings)
    yield data_folder(settings.data)
    yield database(settings)
    yield from extras(settings)
    if is_installed("mujoco"):
        yield opengl()


def misspelled(environment: Mapping[str, str]) -> Iterator[Probe]:
    """Variables that look like settings but are not; the service ignores them."""
    known = [name.upper() for name in {*Settings.model_fields, *CLIENTS_OWN}]
    for variable in environment:
        name = variable.upper().removeprefix(ENV_PREFIX)
        if variable.upper().startswith(ENV_PREFIX) and name not in known:
            near = [ENV_PREFIX + close for close in get_close_matches(name, known, 1)]
            remedy = f"did you mean {near[0]}?" if near else "see docs/settings.md"
            yield Probe(variable, "wrong", "is not a setting, and has no effect", remedy, required=False)


def library(code: str) -> Probe:
    """Whether llama.cpp loads: it may need a system library, or stop on an old processor."""
    if not (seen := _failure_of(code)):
        return Probe("llama.cpp", "ok", "loads")
    remedy = "apt-get install libgomp1" if "libgomp" in seen else "pip install --force-reinstall xllamacpp"
    return Probe("llama.cpp", "wrong", seen, remedy)


def _failure_of(code: str) -> str:
    """Run Python code in a process of its own; return the last line of its error, empty if it has none."""
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    if done.returncode == 0:
        return ""
    return (done.stderr.strip().splitlines() or [f"ends with status {done.returncode}"])[-1]


def model(settings: Settings) -> Probe:
    """Whether the default LLM can be asked; the weights of an embedded one are read and compared with their SHA-256."""
    name = settings.default_model
    try:
        ModelRegistry(settings).profile(name)
        if name.startswith("embedded/"):
            path = find_weights(name.removeprefix("embedded/"), settings.cache_folder)()
            return Probe(f"LLM {name}", "ok", f"weights in {path}")
    except (RoboPromptError, OSError) as error:
        return Probe(f"LLM {name}", "missing", str(error), "as it says, or name another LLM: ROBOPROMPT_DEFAULT_MODEL")
    return Probe(f"LLM {name}", "ok", "is set up; whether it answers is asked by GET /models")


def data_folder(folder: Path) -> Probe:
    """Whether the service may write there; a file is written and removed."""
    name = f"data folder {folder}"
    there = _nearest(folder)
    try:
        if there == folder and (mode := stat.S_IMODE(folder.stat().st_mode)) & OTHERS:
            require_ours(folder, mode)
        with tempfile.TemporaryFile(dir=there):
            pass
    except (RoboPromptError, OSError) as error:
        return Probe(name, "wrong", str(error), "name a folder of this user: --data FOLDER or ROBOPROMPT_DATA")
    return Probe(name, "ok", "can be written" if there == folder else "will be made")


def database(settings: Settings) -> Probe:
    """Whether it answers and its tables are those of its revision; nothing is made or migrated."""
    url = settings.database_url or f"sqlite:///{settings.data / 'roboprompt.db'}"
    try:
        if (parsed := make_url(url)).get_backend_name() == "sqlite" and not Path(parsed.database or "").exists():
            return Probe("database", "ok", "will be made")
        with closing(Database(url)) as opened:
            if not is_newest(opened):
                return Probe("database", "ok", "is older, and is brought up to date when the service starts")
            with opened.read() as connection:
                context = MigrationContext.configure(connection)
                revision, differences = context.get_current_revision(), compare_metadata(context, metadata)
    except (RoboPromptError, ArgumentError) as error:
        return Probe(
            "database", "wrong", str(error), "as it says; a backup is unpacked into an empty folder by `tar -xf`"
        )
    if differences:
        seen = f"its tables are not those of its revision: {len(differences)} differences, first {differences[0]}"
        return Probe("database", "wrong", seen, "it was written before 1.0, or changed by hand: use another folder")
    return Probe("database", "ok", f"answers, at revision {revision}")


def extras(settings: Settings) -> Iterator[Probe]:
    """Whether each extra is installed, and whether the settings need it."""
    needed = {
        "postgres": (settings.database_url or "").startswith("postgresql"),
        "s3": bool(settings.blobs_url),
    }
    for extra, packages in packages_of_extras().items():
        if extra in WHAT_FOR:
            lacking = [package for package in packages if not is_installed(package)]
            seen = f"{', '.join(lacking)}: {WHAT_FOR[extra]}" if lacking else WHAT_FOR[extra]
            remedy = f"pip install 'roboprompt[{extra}]'"
            yield Probe(f"extra {extra}", "missing" if lacking else "ok", seen, remedy, needed.get(extra, False))


def _nearest(folder: Path) -> Path:
    """Return the folder, or the nearest existing one above it."""
    return next(place for place in (folder, *folder.absolute().parents) if place.exists())


def opengl() -> Probe:
    """Whether MuJoCo renders a picture."""
    if not (seen := _failure_of(RENDERS)):
        return Probe("OpenGL", "ok", "the simulation renders pictures", required=False)
    remedy = "apt-get install libegl1 libgl1, or libosmesa6; without, pictures take several times longer"
    return Probe("OpenGL", "missing", seen, remedy, required=False)
