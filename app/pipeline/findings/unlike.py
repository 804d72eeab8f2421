"""Whether an upload does what the task's other demonstrations do: prompts leave a rare way out."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import LEFT_OUT
from app.pipeline.plans import RARE_SHARE

MIN_OTHERS = 3  # demonstrations that tell what is usual


def unlike_findings(new: Demonstration, others: Sequence[Demonstration]) -> Iterator[Finding]:
    """Says so where its gripper opens and closes otherwise than in most demonstrations that ask for the same.

    Args:
        new, others: with the keyframes of their recordings.
    """
    ways = Counter(_way(shown) for shown in others if shown.order.form == new.order.form)
    if ways.total() < MIN_OTHERS:
        return
    own, (usual, number) = _way(new), ways.most_common(1)[0]
    ways[own] += 1
    if own != usual and ways[own] <= RARE_SHARE * ways.total():
        message = (
            f"The gripper switches {len(own) - 1} times, in {number} of the {ways.total() - 1} other demonstrations"
            f" {len(usual) - 1} times: prompts leave this one out, unless more are like it or its scene tells when to"
            " do so. Was something dropped, or grasped twice? Then delete it."
        )
        yield LEFT_OUT.finding(message, "trajectory.gripper_open", {"alike": ways[own], "demonstrations": ways.total()})


def _way(shown: Demonstration) -> tuple[bool, ...]:
    """What the gripper does, from the state in which the hand is on its way."""
    states = [state for state, _ in groupby(action.gripper_open for action in shown.actions)]
    return tuple(states if states[:1] == [True] else [True, *states])
