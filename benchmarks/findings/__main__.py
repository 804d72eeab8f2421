"""Make successes and failures of the simulated tasks, and see which of them had a finding of level warning or above.

`python -m benchmarks.findings --seed N --data DIR --report FILE`. One process simulates; the service runs beside it.
With `--data` demonstrations and outcomes are kept, so that another run asks again and simulates only what is new.
"""

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from app.evaluation.server import running_server
from app.sim.tasks import TASKS
from benchmarks.findings.table import tables, totals
from benchmarks.findings.trials import Outcomes, trials
from roboprompt_client.client import RoboPromptClient

SERVICE = {"ROBOPROMPT_WARM_UP": "false", "ROBOPROMPT_DEFAULT_MODEL": "nearest"}


def main() -> None:
    """Run it and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="of the first demonstration; scenes are 100,000 further")
    parser.add_argument("--episodes", type=int, default=3, help="scenes for each task and condition")
    parser.add_argument("--tasks", nargs="*", default=list(TASKS), choices=list(TASKS), metavar="TASK")
    parser.add_argument("--data", type=Path, help="folder of the service and of what was simulated")
    parser.add_argument("--report", type=Path, help="write the tables to this file, too")
    wished = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as own:
        report = _run(wished, wished.data or Path(own))
    sys.stdout.write(report)
    if wished.report is not None:
        wished.report.write_text(report)


def _run(wished: argparse.Namespace, data: Path) -> str:
    started, done = time.monotonic(), []
    data.mkdir(parents=True, exist_ok=True)
    outcomes = Outcomes(data / "outcomes.jsonl")
    with (
        running_server(data / "service", SERVICE) as url,
        RoboPromptClient(url) as client,
        (data / f"trials-{wished.seed}.jsonl").open("w") as file,
    ):
        for trial in trials(client, wished.tasks, wished.seed, wished.episodes, outcomes):
            done.append(trial)
            file.write(json.dumps(asdict(trial)) + "\n")
            file.flush()
    minutes = (time.monotonic() - started) / 60
    command = f"python -m benchmarks.findings --seed {wished.seed} --episodes {wished.episodes}"
    head = f"`{command}`: {len(done)} trials of {len(wished.tasks)} tasks in {minutes:.0f} minutes."
    return f"{totals(done)}\n\n{head}\n\n{tables(done)}\n"


if __name__ == "__main__":
    main()
