"""Which trials are shown in detail: failures first, and not so many that the report becomes huge."""

from collections.abc import Sequence
from itertools import chain, zip_longest

from app.evaluation.records import Method, Trial

MAX_FAILURES = 12  # a task
MAX_SUCCESSES = 2  # a task


def failures_in_order(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """All failed trials, by method and then as they were run."""
    return list(chain.from_iterable(_by_method(trials, methods, succeeded=False)))


def detailed_failures(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """At most 12 of them: the methods take turns, the first method first."""
    chosen = _in_turns(_by_method(trials, methods, succeeded=False))[:MAX_FAILURES]
    return [trial for trial in failures_in_order(trials, methods) if trial in chosen]


def detailed_successes(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """At most two, of different methods where there are such; replays, which ask nobody, last."""
    in_turns = _in_turns(_by_method(trials, methods, succeeded=True))
    return sorted(in_turns, key=lambda trial: trial.answer is None)[:MAX_SUCCESSES]


def _by_method(trials: Sequence[Trial], methods: Sequence[Method], *, succeeded: bool) -> list[list[Trial]]:
    return [
        [trial for trial in trials if trial.method == method.label and trial.succeeded == succeeded]
        for method in methods
    ]


def _in_turns(groups: Sequence[Sequence[Trial]]) -> list[Trial]:
    return [trial for turn in zip_longest(*groups) for trial in turn if trial is not None]
