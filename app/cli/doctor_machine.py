"""What `roboprompt doctor` looks at of the machine: memory, port, OpenGL."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import httpx

from app.cli.shared import is_installed

MIN_MEMORY_GB = 1.0  # measured: 0.8 with one worker and the embedded LLM
PATIENCE_S = 60.0
RENDERS = "import sys; from app.sim.rendering import opengl_works; sys.exit(not opengl_works())"


@dataclass(frozen=True)
class Row:
    """One thing that was looked at.

    Attributes:
        remedy: what to do where it is not ok.
        required: whether `roboprompt serve` needs it.
    """

    name: str
    state: Literal["ok", "missing", "wrong"]
    seen: str
    remedy: str = ""
    required: bool = True


def look_at_machine(port: int) -> Iterator[Row]:
    """A row for each thing."""
    yield memory(Path("/proc/meminfo"), Path("/sys/fs/cgroup/memory.max"))
    yield listening(port)
    if is_installed("mujoco"):
        yield opengl()


def memory(meminfo: Path, limit: Path) -> Row:
    """What Linux says is available, and a container's limit."""
    try:
        lines = dict(line.split(":", 1) for line in meminfo.read_text().splitlines())
        free_gb = int(lines["MemAvailable"].split()[0]) * 1024 / 1e9
    except (OSError, KeyError, ValueError):
        return Row("memory", "missing", "this system does not say how much is available", "nothing", required=False)
    if limit.is_file() and (text := limit.read_text().strip()).isdigit():
        free_gb = min(free_gb, int(text) / 1e9)
    seen = f"{free_gb:.1f} GB available"
    remedy = f"end other programs, or raise the container's limit, to {MIN_MEMORY_GB:g} GB or more"
    return Row("memory", "ok" if free_gb >= MIN_MEMORY_GB else "wrong", seen, remedy)


def listening(port: int) -> Row:
    """Whether the port is free, or a RoboPrompt service's."""
    name = f"port {port}"
    try:
        with socket.socket() as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(("127.0.0.1", port))
    except PermissionError as error:
        return Row(name, "wrong", str(error), "choose one above 1023: roboprompt serve --port 8001")
    except OSError:
        if _is_ours(port):
            return Row(name, "ok", "a RoboPrompt service answers there")
        return Row(name, "wrong", "another program listens there", f"end it, or roboprompt serve --port {port + 1}")
    return Row(name, "ok", "free")


def _is_ours(port: int) -> bool:
    try:
        with httpx.Client(trust_env=False, timeout=2) as http:
            return "checks" in http.get(f"http://127.0.0.1:{port}/healthz").json()
    except (httpx.HTTPError, ValueError, TypeError):
        return False


def opengl() -> Row:
    """Whether MuJoCo renders a picture, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", RENDERS], capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    if done.returncode == 0:
        return Row("OpenGL", "ok", "the simulation renders pictures", required=False)
    last = (done.stderr.strip().splitlines() or ["it does not render"])[-1]
    remedy = "apt-get install libegl1 libgl1, or libosmesa6; without, pictures take several times longer"
    return Row("OpenGL", "missing", last, remedy, required=False)
