"""`make bench`: everything that is measured of service and LLM layer, in one run, written to docs/results/bench.md.

The numbers are of this machine as it is now: what counts are ratios within one run.
"""

import argparse
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from app.evaluation.run_record import commit, machine, versions
from benchmarks import embedded, service_time
from benchmarks.embedded import Measured
from benchmarks.processes import ROUNDS, Cost

REPORT = Path(__file__).parents[1] / "docs" / "results" / "bench.md"
COMMAND = "make bench"


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=REPORT, help="where the report goes")
    parser.add_argument("--json", action="store_true", help="end with one JSON object")
    arguments = parser.parse_args()
    started_s = time.monotonic()
    service = service_time.measure()
    llm = embedded.measure()
    text = report(service, llm, time.monotonic() - started_s)
    arguments.output.write_text(text)
    print(text)  # noqa: T201
    if arguments.json:
        print(json.dumps({"service": service, "llm": llm}, default=vars))  # noqa: T201


def report(service: Mapping[str, Cost], llm: Measured, seconds: float) -> str:
    """The page."""
    return (
        "\n\n".join(
            [
                "# Benchmarks of the service and the LLM layer",
                _where(seconds),
                "## A prediction outside the LLM",
                f"`POST /predict` with given poses, {service_time.NUM_DEMONSTRATIONS} demonstrations of six actions, a "
                "scripted LLM; the reply parsed, the prediction stored (one fsync). CPU is that of the whole server "
                "process, the access log's and the scripted LLM's included; the last row has the latter alone.",
                _table(("", "server CPU, ms", "wall, ms"), [(name, *_cost(item)) for name, item in service.items()]),
                "## Cached prefixes",
                _prefixes(llm),
                "## Streaming",
                f"With a warm prefix, {llm.streaming.num_actions:.0f} actions: the first after "
                f"{llm.streaming.first_action_s:.2f} s, the whole reply after {llm.streaming.whole_s:.2f} s "
                f"({llm.streaming.first_action_s / llm.streaming.whole_s:.0%}).",
                "## Several robots",
                "Each asks for another scene of one task as soon as it is answered, "
                f"{embedded.ROBOTS_S:.0f} s; the embedded model has four slots, one of which knows the task at first.",
                _robots(llm),
                "## Tokens of a prediction",
                "The same ten demonstrations and the same scene, no system prompt, tokens of the embedded model.",
                _tokens(llm),
            ]
        )
        + "\n"
    )


def _where(seconds: float) -> str:
    known, here = versions(), machine()
    packages = ", ".join(f"{name} {known[name]}" for name in ("python", "fastapi", "numpy", "xllamacpp"))
    made = f"{datetime.now(UTC):%Y-%m-%d}, commit {commit()}, {here['processor']}, {here['cores']} cores; {packages}"
    how = f"Medians, CPU of the best of {ROUNDS} rounds; the ratios count, not the absolute times."
    return f"`{COMMAND}`, {seconds / 60:.1f} minutes. {made}. {how}"


def _prefixes(llm: Measured) -> str:
    found, after = llm.prefixes, llm.after_upload
    return (
        f"Prompts of {found.prompt_tokens:.0f} tokens. Of a task's second prediction {found.cached_share:.1%} of the "
        f"prompt tokens are cached; its first token comes after {found.warm_s * 1000:.0f} ms instead of "
        f"{found.cold_s:.2f} s ({found.cold_s / found.warm_s:.0f} times sooner). The first prediction after the upload "
        f"of ten episodes takes {after.prefix_warmed_s:.2f} s where the prefix was warmed in the background, "
        f"{after.prefix_cold_s:.2f} s where it was not."
    )


def _robots(llm: Measured) -> str:
    head = ("robots at once", "until each had its first answer, s", "then predictions a minute", "failed")
    rows = ((r.robots, f"{r.first_s:.1f}", f"{r.predictions_per_minute:.0f}", r.failures) for r in llm.robots)
    return _table(head, (tuple(map(str, row)) for row in rows))


def _tokens(llm: Measured) -> str:
    theirs = next(item for item in llm.tokens if item.name == "the authors'")
    rows = [
        (item.name, str(item.prompt), str(item.completion), f"{item.prompt / theirs.prompt:.2f}") for item in llm.tokens
    ]
    return _table(("format", "prompt", "reply", "prompt against the authors'"), rows)


def _cost(item: Cost) -> tuple[str, str]:
    return f"{item.cpu_ms:.2f}", f"{item.wall_ms:.2f}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    main()
