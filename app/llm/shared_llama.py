"""One llama.cpp process for all processes that use a model on this machine, such as several uvicorn workers.

Whoever needs the model first starts it and writes its address and key to a file that only this user can read; the
others read it. When its owner ends, llama.cpp ends, too; the next one that needs it starts it again.
"""

import fcntl
import hashlib
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import httpx

from app.llm.base import ModelUnavailableError
from app.llm.llama_process import LlamaOptions, LlamaProcess

PROBE_TIMEOUT_S = 5.0
POLL_S = 0.1


class SharedLlama:
    """A LlamaProcess of this process or of another; the same methods. Blocking: use a thread.

    Args:
        folder: where the processes leave notes for each other; created if it is not there.

    Attributes:
        base_url: of its OpenAI-compatible API.
        api_key: what a request must carry.

    Raises:
        ModelUnavailableError: as LlamaProcess, or if the folder cannot be written.
    """

    def __init__(self, options: LlamaOptions, folder: Path) -> None:
        note = folder / f"llama-{_name(options)}.json"
        self._process: LlamaProcess | None = None
        self._gone = False
        with _locked(note):
            found = _read(note)
            if found is None or not _answers(*found):
                self._process = LlamaProcess(options)
                found = (self._process.base_url, options.api_key)
                _write(note, found)
        self.base_url, self.api_key = found

    @property
    def running(self) -> bool:
        """Whether it still lives; of another process's, whether `ends_within` has not found it gone."""
        return self._process.running if self._process else not self._gone

    def ends_within(self, timeout_s: float) -> bool:
        """Whether it ends by itself; waits for it."""
        if self._process:
            return self._process.ends_within(timeout_s)
        deadline = time.monotonic() + timeout_s
        while not self._gone and time.monotonic() < deadline:
            self._gone = not _answers(self.base_url, self.api_key)
            time.sleep(POLL_S)
        return self._gone

    def stop(self) -> None:
        """End it if it is this process's; otherwise leave it alone."""
        if self._process:
            self._process.stop()


def _name(options: LlamaOptions) -> str:
    """The same for equal options, whatever the key."""
    return hashlib.sha256(json.dumps(asdict(replace(options, api_key=""))).encode()).hexdigest()[:16]


@contextmanager
def _locked(note: Path) -> Iterator[None]:
    try:
        note.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = os.fdopen(os.open(note.with_suffix(".lock"), os.O_WRONLY | os.O_CREAT, 0o600), "w")
    except OSError as error:
        raise ModelUnavailableError(f"workers cannot share a model: {error}") from error
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _read(note: Path) -> tuple[str, str] | None:
    try:
        found = json.loads(note.read_text())
        return found["url"], found["api_key"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(note: Path, found: tuple[str, str]) -> None:
    temporary = note.with_suffix(".tmp")
    temporary.unlink(missing_ok=True)
    with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        json.dump({"url": found[0], "api_key": found[1]}, file)
    temporary.replace(note)


def _answers(url: str, api_key: str) -> bool:
    """Whether llama.cpp answers there and knows the key: the port may be somebody else's by now."""
    try:
        headers = {"Authorization": f"Bearer {api_key}"}
        return httpx.get(f"{url}/models", headers=headers, timeout=PROBE_TIMEOUT_S, trust_env=False).is_success
    except httpx.TransportError:
        return False
