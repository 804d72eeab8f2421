"""llama.cpp's HTTP server in a child process: how it starts and stops, and why it failed.

The workers of `serve --workers` share one, which the process that starts them runs for the default model; its address
and key are in their environment. A worker that finds it ended starts one of its own.
"""

import contextlib
import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

import httpx

from app.llm.base import ModelUnavailableError
from app.llm.llama import child
from app.llm.sse import Server

STOP_TIMEOUT_S = 5.0
GIVEN = "ROBOPROMPT_LLAMA"  # in the environment of workers: the address, key and options of the parent's server
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
        api_key: what a request must carry: other users of the machine reach a loopback port as well.
    """

    model: str
    slots: int
    context_tokens: int
    threads: int
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
        self.server = Server(f"{json.loads(answer)['url']}/v1", options.api_key)

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


class GivenLlama:
    """The server of a parent process (see `given_to_children`); the same methods. Blocking: use a thread."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.running = True

    def ends_within(self, timeout_s: float) -> bool:
        """Whether it ends by itself; waits for it."""
        deadline = time.monotonic() + timeout_s
        while self.running and time.monotonic() < deadline:
            self.running = _answers(self.server)
            time.sleep(POLL_S)
        return not self.running

    def stop(self) -> None:
        """Nothing: it is the parent's."""


@contextmanager
def given_to_children(options: LlamaOptions) -> Iterator[None]:
    """Run a server that processes started meanwhile share, by `launch` with equal options but for the key.

    Raises:
        ModelUnavailableError: as LlamaProcess.
    """
    process = LlamaProcess(options)
    os.environ[GIVEN] = json.dumps({"options": _named(options), "url": process.server.base_url, "key": options.api_key})
    try:
        yield
    finally:
        del os.environ[GIVEN]
        process.stop()


def launch(options: LlamaOptions) -> LlamaProcess | GivenLlama:
    """The parent's server of these options while it answers, else one of this process. Raises as LlamaProcess."""
    given = json.loads(os.environ.get(GIVEN, "{}"))
    if given and given["options"] == _named(options):
        server = Server(given["url"], given["key"])
        if _answers(server):
            return GivenLlama(server)
    return LlamaProcess(options)


def _named(options: LlamaOptions) -> list[object]:
    """The same for equal options, whatever the key."""
    return [options.model, options.slots, options.context_tokens, options.threads]


def _answers(server: Server) -> bool:
    headers = {"Authorization": f"Bearer {server.key}"}
    try:
        url = f"{server.base_url}/models"
        return httpx.get(url, headers=headers, timeout=PROBE_TIMEOUT_S, trust_env=False).is_success
    except httpx.TransportError:
        return False
