"""Recordings that have two objects under each other's names: with the names exchanged they act as the others do."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.elsewhere import from_shown_m
from app.pipeline.findings.rules import EXCHANGED
from app.pipeline.plans.rows import BEYOND_NOISE_M
from app.pipeline.plans.support import Support

SAME_M = BEYOND_NOISE_M / 2  # from where the usual plan would act: does the same


def exchanged_findings(alike: Sequence[Demonstration]) -> Iterator[Finding]:
    """The two objects whose exchange explains most of the demonstrations that act elsewhere than the usual plan.

    Their scenes differ with the names, so that plans seem to follow from the scenes. One object must be in the
    instruction, which says what to act on; where no word names either, a scene may well decide between them.

    Args:
        alike: that ask for the same.
    """
    kinds = Counter(demonstration.kind for demonstration in alike)
    usual = kinds.most_common(1)[0][0]
    if len(kinds) == 1 or not all(demonstration.actions for demonstration in alike):
        return
    support = Support.of([[item for item in alike if item.kind == usual]])
    others = [d for d in alike if d.kind != usual and from_shown_m(support, d) > BEYOND_NOISE_M]
    explained: Counter[tuple[str, str]] = Counter()
    for other in others:
        for one, second in permutations((pose.name for pose in other.objects), 2):
            if one in other.order.objects and from_shown_m(support, _exchanged(other, one, second)) < SAME_M:
                explained[one, second] += 1
    if not explained:
        return
    (one, second), number = explained.most_common(1)[0]
    if EXCHANGED.severity(number / len(alike)) is not None:
        message = (
            f"{number} of {len(alike)} demonstrations of {alike[0].instruction!r} do what the others do if {one} and"
            f" {second} have each other's names there. Correct or delete those that are named wrongly."
        )
        yield EXCHANGED.finding(message, "demonstrations", {"share": number / len(alike)}, value=number / len(alike))


def _exchanged(shown: Demonstration, one: str, other: str) -> Demonstration:
    names = {one: other, other: one}
    return replace(shown, objects=tuple(replace(p, name=names.get(p.name, p.name)) for p in shown.objects))
