"""Demonstrations of one plan: the same grasps and releases, the same number of rows, and rows that agree.

What people record differs in more than matters: they pass corners sooner or later, hesitate, reach a little farther.
A language model that continues a pattern needs to see what is the same.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

from app.pipeline.groups import Group, made_by_group
from app.pipeline.plans.agreement import agreed
from app.pipeline.plans.alignment import aligned
from app.pipeline.plans.recording import Recording


def demonstrated(recordings: Sequence[Recording]) -> Group:
    """The demonstrations with aligned rows, as recorded; unaligned if the keyframe rule does not align."""
    if recordings and recordings[0].rule.aligned:
        return aligned_by_plan(recordings)
    return tuple(replace(recording.demonstration, start=None) for recording in recordings)


def aligned_by_plan(recordings: Sequence[Recording]) -> Group:
    """The recordings' demonstrations, those of one plan with equally many actions."""
    return made_by_group(recordings, attrgetter("demonstration.order.form"), aligned)


def agreeing(demonstrations: Group) -> Group:
    """The demonstrations with each row at the robust mean of its plan, where the demonstrations agree on one."""
    return made_by_group(demonstrations, attrgetter("kind"), agreed)
