"""Starts the service in a child process on a free loopback port.

`python -m app.evaluation.server MODULE ...` is such a process: it runs a module and ends with its parent process.
Standard input is a pipe from the parent, which breaks when the parent ends, even if it was killed.
"""

import os
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TextIO

import httpx

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import RoboPromptError

# The environment may require API keys of another service; this one needs none.
WITHOUT_KEYS = {"ROBOPROMPT_AUTH": "auto"}
START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 15.0
POLL_S = 0.05


class ServerStartError(RoboPromptError):
    """The service did not start; the message ends with what it wrote last."""


@contextmanager
def running_server(
    data: Path, environment: Mapping[str, str] | None = None, arguments: Sequence[str] = ()
) -> Iterator[str]:
    """Run `roboprompt serve` on `data`, yield its URL, and end it.

    Args:
        environment: additional settings, e.g. ``{"ROBOPROMPT_DEFAULT_MODEL": "regression"}``.
        arguments: additional arguments of `roboprompt serve`.

    Raises:
        ServerStartError: if it does not answer within a minute.
    """
    data.mkdir(0o700, parents=True, exist_ok=True)
    settings = {**WITHOUT_KEYS, **(environment or {})}
    with running(["app.cli", "serve", "--data", str(data), *arguments], settings, data / "server.log") as (url, _):
        yield url


@contextmanager
def running(
    module: Sequence[str], environment: Mapping[str, str], log_file: Path
) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run `python -m MODULE ... --port PORT`, which answers `GET /healthz`, and yield its URL and process.

    Raises:
        ServerStartError: if it does not answer within a minute.
    """
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    with log_file.open("w+") as log:
        process = _leashed([*module, "--port", str(port)], environment, log)
        try:
            _wait_until_alive(process, url, log_file)
            yield url, process
        finally:
            _stop(process)


@contextmanager
def service(
    url: str | None = None,
    *,
    warm_up: bool = True,
    data: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> Iterator[RoboPromptClient]:
    """Yield a client of the service at `url`, or of a new service.

    Args:
        warm_up: whether a new service starts its default LLM at once.
        data: folder of a new service, which is kept; None: an empty one that is removed afterwards.
        environment: additional settings of a new service.

    Raises:
        ServerStartError.
    """
    with ExitStack() as stack:
        if url is None:
            folder = data or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="roboprompt-")))
            url = stack.enter_context(
                running_server(folder, {"ROBOPROMPT_WARM_UP": str(warm_up), **(environment or {})})
            )
        yield stack.enter_context(RoboPromptClient(url))


def free_port() -> int:
    """Return a free TCP port."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port: int = listener.getsockname()[1]
        return port


def _leashed(command: Sequence[str], environment: Mapping[str, str], log: TextIO) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "app.evaluation.server", *command],  # -P: no `app` of the current folder
        stdin=subprocess.PIPE,
        stdout=log,
        stderr=subprocess.STDOUT,
        env={**os.environ, **environment},
        start_new_session=True,  # Ctrl-C is for this process to handle
    )


def _wait_until_alive(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    with httpx.Client(trust_env=False) as http:  # creating a client takes as long as the pause
        while time.monotonic() < deadline and process.poll() is None:
            try:
                if http.get(f"{url}/healthz").is_success:
                    return
            except httpx.TransportError:
                time.sleep(POLL_S)
    raise ServerStartError(f"the service did not start; {log} ends with:\n{log.read_text()[-2000:]}")


def _stop(process: subprocess.Popen[bytes]) -> None:
    with process:
        process.terminate()
        try:
            process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()


def main() -> None:
    """Run the module that the command line names, as `python -m` would, until it or the parent ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    while os.read(0, 1024):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
