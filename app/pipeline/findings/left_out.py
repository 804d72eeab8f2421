"""Demonstrations that others overrule: prompts leave out a rare plan, and move a row to where most of a plan act."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import LEFT_OUT
from app.pipeline.order.vocabulary import COUNTED_FROM, FAR, NEAR, PLACE_ADJECTIVES
from app.pipeline.plans.rows import BEYOND_NOISE_M
from roboprompt_client.arrays import Array

LISTED = 3  # ids that a sentence names
PLACE_WORDS = frozenset({*COUNTED_FROM, *FAR, *NEAR, *PLACE_ADJECTIVES})  # that say which of several objects


def overruled_findings(
    alike: Sequence[Demonstration], off_m: Sequence[float | None], *, declared: bool
) -> Iterator[Finding]:
    """The demonstrations that an answer does not follow, in one finding.

    Where words say by its place which object is meant, and some act at another one, the place decides: what is
    overruled is right.

    Args:
        alike: that ask for the same.
        off_m: of each, how far it acts from where the others of its plan do; None where prompts leave it out.
        declared: whether the task says that there are several ways.
    """
    left = [k for k, far_m in enumerate(off_m) if far_m is None and alike[k].plan is not None]
    away_m = _away_m(alike) if left else off_m
    moved = [k for k, far_m in enumerate(off_m) if far_m is not None and far_m > BEYOND_NOISE_M]
    elsewhere = [*moved, *(k for k in left if (away_m[k] or 0.0) > BEYOND_NOISE_M)]
    overruled = sorted({*left, *moved})
    if not overruled:
        return
    listed = ", ".join(alike[k].id for k in overruled[:LISTED])
    more = f" and {len(overruled) - LISTED} more" if overruled[LISTED:] else ""
    message = (
        f"Of {len(alike)} demonstrations of {alike[0].instruction!r} the answer does not follow {len(overruled)}:"
        f" {listed}{more}. {_reason(len(elsewhere))}"
    )
    by_place = not PLACE_WORDS.isdisjoint(alike[0].order.form.split())
    share = len(elsewhere) / len(alike)
    value = 0.0 if declared else 1.0 if by_place and elsewhere else share
    numbers = {"left_out": len(left), "elsewhere": len(elsewhere), "demonstrations": len(alike)}
    yield LEFT_OUT.finding(message, "demonstrations", numbers, value=value)


def _reason(num_elsewhere: int) -> str:
    if not num_elsewhere:
        return "Their plan is a rare one, such as a second try."
    return (
        f"{num_elsewhere} of them act 8 cm or more from where the others do: delete what was recorded wrongly, and name"
        " the object in the instruction where something else decides which one is meant."
    )


def _away_m(alike: Sequence[Demonstration]) -> Array:
    """(N,) how much nearer to, or farther from, the object that most act at each acts than most do."""
    acted_m = [_acts_at_m(demonstration) for demonstration in alike]
    distances_m = [
        {_role(d, pose.name): float(np.linalg.norm(pose.position_m - at_m)) for pose in d.objects}
        for d, at_m in zip(alike, acted_m, strict=True)
    ]
    usual = Counter(min(roles, key=roles.__getitem__) for roles in distances_m).most_common(1)[0][0]
    from_usual_m = np.array([roles[usual] for roles in distances_m])
    away: Array = np.abs(from_usual_m - np.median(from_usual_m))
    return away


def _acts_at_m(demonstration: Demonstration) -> Array:
    """(3,) where the gripper first switches; without a switch where the hand is lowest."""
    actions = demonstration.actions
    switches = [k for k in range(1, len(actions)) if actions[k].gripper_open != actions[k - 1].gripper_open]
    first = switches[0] if switches else int(np.argmin([action.position_m[2] for action in actions]))
    return actions[first].position_m


def _role(demonstration: Demonstration, name: str) -> str:
    """The object's place in the instruction, or its name."""
    mentioned = demonstration.order.objects
    return f"<{mentioned.index(name)}>" if name in mentioned else name
