"""Schemathesis over the whole OpenAPI document, against a real service.

`python -m tests.reliability.fuzz` asks thousands of questions; tests/reliability/test_fuzz.py a few hundred.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import httpx

from tests.reliability.service import QUESTION, serving, upload_files

# An LLM whose reply is no list of actions is answered with 502, and must be.
CONFIGURATION = """
[checks]
not_a_server_error.expected-statuses = ["2xx", "3xx", "4xx", 502]
"""
ROOT = Path(__file__).parents[2]
CHECKS = "not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance"


def fuzz(data, max_examples, phases, seed=1):
    """(exit status, report, log of the service)."""
    with serving(data) as service:
        for number in range(3):
            httpx.post(f"{service.url}/episodes", files=upload_files(number)).raise_for_status()
        httpx.post(f"{service.url}/predict", json=QUESTION).raise_for_status()
        (configuration := data / "schemathesis.toml").write_text(CONFIGURATION)
        program = [Path(sys.executable).with_name("schemathesis"), "--config-file", configuration]
        command = [*program, "run", f"{service.url}/openapi.json", "--no-color"]
        options = ["--checks", CHECKS, "--phases", phases, "--max-examples", str(max_examples), "--seed", str(seed)]
        database = ["--generation-database", "none"]
        run = subprocess.run(
            [*command, *options, *database],
            capture_output=True,
            text=True,
            check=False,
            cwd=data,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        return run.returncode, run.stdout + run.stderr, service.log()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        number = int(sys.argv[1]) if len(sys.argv) > 1 else 300
        status, report, log = fuzz(Path(folder) / "data", number, "examples,coverage,fuzzing,stateful")
    sys.stdout.write(report)
    if "Traceback" in log:
        sys.stdout.write(log[log.index("Traceback") :][:5000])
        status = 1
    sys.exit(status)
