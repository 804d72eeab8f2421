"""`make bench`: everything that is measured of service and LLM layer, in one run, written to docs/results/bench.md.

The numbers are of this machine as it is now: what counts are ratios within one run.
"""

import argparse
import time
from datetime import UTC, datetime
from pathlib import Path

from app.evaluation.sweep_run import commit, machine, versions
from app.evaluation.tables import TextTable
from benchmarks import embedded, service_time

REPORT = Path(__file__).parents[1] / "docs" / "results" / "bench.md"


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=REPORT, help="where the report goes")
    output = parser.parse_args().output
    started_s = time.monotonic()
    costs = [(name, f"{cost.cpu_ms:.2f}", f"{cost.wall_ms:.2f}") for name, cost in service_time.measure().items()]
    sections = list(embedded.sections())
    text = "\n\n".join(
        [
            "# Benchmarks of the service and the LLM layer",
            _where(time.monotonic() - started_s),
            "## A prediction outside the LLM",
            f"`POST /predict` with given poses, {service_time.NUM_DEMONSTRATIONS} demonstrations of six actions, a "
            "scripted LLM; the reply parsed, the prediction stored (one fsync). CPU is that of the whole server "
            "process, the access log's and the scripted LLM's included; the last row has the latter alone.",
            TextTable(("", "server CPU, ms", "wall, ms"), [costs]).markdown(),
            *sections,
        ]
    )
    output.write_text(text + "\n")
    print(text)  # noqa: T201


def _where(seconds: float) -> str:
    known, here = versions(), machine()
    packages = ", ".join(f"{name} {known[name]}" for name in ("python", "fastapi", "numpy", "xllamacpp"))
    made = f"{datetime.now(UTC):%Y-%m-%d}, commit {commit()}, {here['processor']}, {here['cores']} cores; {packages}"
    how = f"Medians, CPU of the best of {service_time.ROUNDS} rounds; the ratios count, not the absolute times."
    return f"`make bench`, {seconds / 60:.1f} minutes. {made}. {how}"


if __name__ == "__main__":
    main()
