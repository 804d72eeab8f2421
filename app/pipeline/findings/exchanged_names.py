"""Demonstrations in which the names of two objects seem to be exchanged."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.outliers import ALIKE_M, off_plans_m
from app.pipeline.findings.rules import NAMES_EXCHANGED
from app.pipeline.plans.support import Support
from app.pipeline.thresholds import BEYOND_NOISE_M


def exchanged_findings(alike: Sequence[Demonstration]) -> Iterator[Finding]:
    """Yield a finding if demonstrations would act where the usual plan acts if two names were exchanged back.

    The instruction must name one of the two objects; otherwise the scene may decide between them.

    Args:
        alike: demonstrations that ask for the same.
    """
    kinds = Counter(demonstration.kind for demonstration in alike)
    usual = kinds.most_common(1)[0][0]
    if len(kinds) == 1 or not all(demonstration.actions for demonstration in alike):
        return
    support = Support.of([[item for item in alike if item.kind == usual]])
    unlike = [item for item in alike if item.kind != usual and off_plans_m(support, item) > BEYOND_NOISE_M]
    explained = Counter(names for item in unlike for names in _explaining_names(support, item))
    if not explained:
        return
    (one, other), number = explained.most_common(1)[0]
    share = number / len(alike)
    message = (
        f"In {number} of {len(alike)} demonstrations of {alike[0].instruction!r} the names of {one} and {other} seem"
        " to be exchanged: with them exchanged back, the hand acts as in the others. Correct or delete these."
    )
    yield from NAMES_EXCHANGED.findings(share, message, "demonstrations", share=share)


def _explaining_names(support: Support, shown: Demonstration) -> Iterator[tuple[str, str]]:
    """Yield the pairs of names whose exchange makes the demonstration act as the plan does."""
    for one, other in permutations((pose.name for pose in shown.objects), 2):
        if one in shown.order.objects and off_plans_m(support, _with_exchanged(shown, one, other)) < ALIKE_M:
            yield one, other


def _with_exchanged(shown: Demonstration, one: str, other: str) -> Demonstration:
    names = {one: other, other: one}
    return replace(shown, objects=tuple(replace(pose, name=names.get(pose.name, pose.name)) for pose in shown.objects))
