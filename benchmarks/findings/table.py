"""What trials say about findings, as Markdown: misses first."""

from collections import Counter
from collections.abc import Sequence

from benchmarks.findings.trials import Attempt

LOUD = ("warning", "danger")


def is_found(trial: Attempt) -> bool:
    """Whether somebody who read the findings would have looked."""
    return any(finding["severity"] in LOUD for finding in trial.findings)


def tables(trials: Sequence[Attempt]) -> str:
    """Per condition, per finding, and the failures that nothing pointed at."""
    return "\n\n".join([_by_condition(trials), _by_code(trials), _missed(trials), _refusals(trials)])


def totals(trials: Sequence[Attempt]) -> str:
    """Both rates in a sentence."""
    failures, successes = _split(trials)
    return f"{_share(failures)} of the failures have a warning or danger, and {_share(successes)} of the successes."


def _split(trials: Sequence[Attempt]) -> tuple[list[Attempt], list[Attempt]]:
    answered = [trial for trial in trials if not trial.refusal]
    return [t for t in answered if not t.succeeded], [t for t in answered if t.succeeded]


def _share(trials: Sequence[Attempt]) -> str:
    found = sum(map(is_found, trials))
    return f"{found} of {len(trials)} ({100 * found / len(trials):.0f} %)" if trials else "-"


def _missing(trials: Sequence[Attempt]) -> float:
    failures = _split(trials)[0]
    return sum(map(is_found, failures)) / len(failures) if failures else 2.0


def _by_condition(trials: Sequence[Attempt]) -> str:
    groups = [[t for t in trials if t.condition == name] for name in dict.fromkeys(t.condition for t in trials)]
    lines = ["| condition | failures with a finding | successes with a finding | refused |", "|---|---|---|---|"]
    for group in sorted(groups, key=_missing):
        failures, successes = _split(group)
        refused = sum(bool(t.refusal) for t in group)
        lines.append(f"| {group[0].condition} | {_share(failures)} | {_share(successes)} | {refused} of {len(group)} |")
    failures, successes = _split(trials)
    refused = sum(bool(t.refusal) for t in trials)
    lines.append(f"| **all** | {_share(failures)} | {_share(successes)} | {refused} of {len(trials)} |")
    return "\n".join(lines)


def _by_code(trials: Sequence[Attempt]) -> str:
    failures, successes = _split(trials)
    ends = {"failures": Counter(map_codes(failures)), "successes": Counter(map_codes(successes))}
    kinds = sorted({*ends["failures"], *ends["successes"]}, key=lambda kind: -ends["successes"][kind])
    lines = ["| finding | severity | in successes | in failures |", "|---|---|---|---|"]
    lines += [f"| `{c}` | {s} | {ends['successes'][c, s]} | {ends['failures'][c, s]} |" for c, s in kinds]
    return "\n".join(lines)


def map_codes(trials: Sequence[Attempt]) -> list[tuple[str, str]]:
    """Code and severity of every finding, each once a trial."""
    return [kind for trial in trials for kind in {(f["code"], f["severity"]) for f in trial.findings}]


def _missed(trials: Sequence[Attempt]) -> str:
    missed = Counter((t.condition, t.task) for t in _split(trials)[0] if not is_found(t))
    lines = ["| failures without a finding | task | number |", "|---|---|---|"]
    return "\n".join(lines + [f"| {c} | {task} | {n} |" for (c, task), n in sorted(missed.items())])


def _refusals(trials: Sequence[Attempt]) -> str:
    refusals = Counter((t.condition, t.refusal) for t in trials if t.refusal)
    lines = ["| refused | problem | number |", "|---|---|---|"]
    return "\n".join(lines + [f"| {c} | {problem} | {n} |" for (c, problem), n in sorted(refusals.items())])
