"""llama.cpp's HTTP server in a child process: how it starts and stops, and why it failed.

All processes that use a model on this machine, such as several uvicorn workers, share one. The first that needs
the model starts it and writes its address and key to a file that only this user can read; the others read it. When its
owner ends, llama.cpp ends, too; the next one that needs it starts it again.
"""

import contextlib
import fcntl
import hashlib
import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TextIO

import httpx

from app.llm.base import ModelUnavailableError
from app.llm.llama import child
from app.llm.sse import Server

STOP_TIMEOUT_S = 5.0
# OpenMP's threads wait for each other by spinning, by default so long that on a busy machine decoding drops from 70 to
# 3 tokens/s. Spinning this briefly costs nothing on an idle machine (70 tokens/s) and keeps 20 on a busy one.
SPIN_COUNT = {"GOMP_SPINCOUNT": "1000"}
PROBE_TIMEOUT_S = 5.0
POLL_S = 0.1


@dataclass(frozen=True)
class LlamaOptions:
    """How llama.cpp serves a model.

    Attributes:
        model: path of the GGUF file.
        slots: requests answered at once.
        context_tokens: longest prompt plus reply of a slot.
        kept_folder: where what the slots have read is kept from the end to the next start; empty: nowhere.
        api_key: what a request must carry: other users of the machine reach a loopback port as well.
    """

    model: str
    slots: int
    context_tokens: int
    threads: int
    kept_folder: str = ""
    api_key: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)


class LlamaProcess:
    """A running server; it ends with `stop` or with this process, whichever comes first. Blocking: use a thread.

    Attributes:
        server: its OpenAI-compatible API.

    Raises:
        ModelUnavailableError: if it does not come up; says what llama.cpp said.
    """

    def __init__(self, options: LlamaOptions) -> None:
        with tempfile.TemporaryFile("w+") as errors:
            self._process = subprocess.Popen(
                # -P: the child's own folder must not shadow the modules it imports
                [sys.executable, "-P", str(Path(child.__file__))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                env={**SPIN_COUNT, **os.environ},
                start_new_session=True,  # Ctrl+C is for the parent to handle
            )
            answer = self._ask(json.dumps(asdict(options)))
            if not answer:
                self.stop()
                errors.seek(0)
                remedy = f"it must be a model that llama.cpp knows, with memory for {options.slots} requests"
                reason = f"llama.cpp cannot serve {options.model} ({_last_line(errors.read())})"
                raise ModelUnavailableError(f"{reason}; {remedy} of {options.context_tokens} tokens")
        self.server = Server(f"{json.loads(answer)['url']}/v1", options.api_key, trust_env=False)

    @property
    def pid(self) -> int:
        """The id of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def ends_within(self, timeout_s: float) -> bool:
        """Whether the process ends by itself; waits for it."""
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def stop(self) -> None:
        """End the process and free its port and memory; requests under way break off."""
        with self._process as process:
            assert process.stdin
            with contextlib.suppress(BrokenPipeError):  # it has ended already
                process.stdin.close()
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()

    def _ask(self, line: str) -> str:
        """The child's answer to its options; empty if it ended instead."""
        assert self._process.stdin
        assert self._process.stdout
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return ""
        return self._process.stdout.readline()


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip() if lines else "it ended without a message"


class SharedLlama:
    """A LlamaProcess of this process or of another; the same methods. Blocking: use a thread.

    Args:
        folder: where the processes leave notes for each other; created if it is not there.

    Attributes:
        server: its OpenAI-compatible API.

    Raises:
        ModelUnavailableError: as LlamaProcess, or if the folder cannot be written.
    """

    def __init__(self, options: LlamaOptions, folder: Path) -> None:
        self._process: LlamaProcess | None = None
        self._gone = False
        with _locked_note(folder / f"llama-{_name(options)}.json") as note:
            found = _server_in(note.read())
            if found is None or not _answers(found):
                self._process = LlamaProcess(options)
                found = self._process.server
                note.seek(0)
                note.truncate()
                json.dump({"url": found.base_url, "api_key": found.key}, note)
        self.server = found

    @property
    def running(self) -> bool:
        """Whether it runs; if another process started it, whether `ends_within` has not found it ended."""
        return self._process.running if self._process else not self._gone

    def ends_within(self, timeout_s: float) -> bool:
        """Whether it ends by itself; waits for it."""
        if self._process:
            return self._process.ends_within(timeout_s)
        deadline = time.monotonic() + timeout_s
        while not self._gone and time.monotonic() < deadline:
            self._gone = not _answers(self.server)
            time.sleep(POLL_S)
        return self._gone

    def stop(self) -> None:
        """End it if it is this process's; otherwise do nothing."""
        if self._process:
            self._process.stop()


def _name(options: LlamaOptions) -> str:
    """The same for equal options, whatever the key."""
    return hashlib.sha256(json.dumps(asdict(replace(options, api_key=""))).encode()).hexdigest()[:16]


@contextmanager
def _locked_note(path: Path) -> Iterator[TextIO]:
    """Open a file that only this user can read; one process at a time has it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o600), "r+")
    except OSError as error:
        raise ModelUnavailableError(f"workers cannot share a model: {error}") from error
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield file


def _server_in(note: str) -> Server | None:
    try:
        found = json.loads(note)
        return Server(found["url"], found["api_key"], trust_env=False)
    except (ValueError, KeyError, TypeError):
        return None


def _answers(server: Server) -> bool:
    """Whether llama.cpp answers there and knows the key: another program may have the port by now."""
    headers = {"Authorization": f"Bearer {server.key}"}
    try:
        url = f"{server.base_url}/models"
        return httpx.get(url, headers=headers, timeout=PROBE_TIMEOUT_S, trust_env=server.trust_env).is_success
    except httpx.TransportError:
        return False
