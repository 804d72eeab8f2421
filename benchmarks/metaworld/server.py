"""A service of the benchmark's own, in a process of another environment."""

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from benchmarks.metaworld.service import ServiceError

START_TIMEOUT_S = 180.0  # on a busy machine
STOP_TIMEOUT_S = 15.0


@contextmanager
def own_service(python: Path) -> Iterator[str]:
    """A service on a free port with a temporary data folder, until the block ends; yields its URL.

    Args:
        python: of an environment that has the server.

    Raises:
        ServiceError: if it does not answer within three minutes.
    """
    url = f"http://127.0.0.1:{(port := _free_port())}"
    # The leash ends the server when this process ends, however it does.
    command = [str(python), "-m", "app.evaluation.leash", "app.cli", "serve", "--port", str(port), "--data"]
    with tempfile.TemporaryDirectory(prefix="roboprompt-metaworld-") as folder:
        log = Path(folder) / "server.log"
        with log.open("w") as output:
            process = subprocess.Popen(
                [*command, f"{folder}/data"],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, "ROBOPROMPT_AUTH": "auto"},
                start_new_session=True,  # Ctrl-C is for this process to handle
            )
        with process:
            try:
                _wait_until_alive(process, url, log)
                yield url
            finally:
                _stop(process)


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def _wait_until_alive(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    with httpx.Client() as http:
        while time.monotonic() < deadline and process.poll() is None:
            try:
                if http.get(f"{url}/healthz").is_success:
                    return
            except httpx.TransportError:
                time.sleep(0.05)
    raise ServiceError(f"the service did not start; its log ends with:\n{log.read_text()[-2000:]}")


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
