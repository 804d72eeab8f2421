"""Stored episodes -> demonstrations, with the task's symmetries and plans whose rows agree."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.episode import Demonstration
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.hand import RecordedHand, kept
from app.pipeline.findings.sources import Compared
from app.pipeline.plans import Recording, agreeing, demonstrated
from app.pipeline.plans.choice import PlanChooser
from app.pipeline.plans.turn import folded
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord
from app.store.trajectories import get_trajectories


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Some of a task's demonstrations.

    Attributes:
        shown: as a prompt shows them.
        recorded: the same as they were recorded, before rows of one plan were made to agree.
        aligned: whether those of one plan have equally many rows.
        hands: what the hand did in the recording of each; empty where that is not needed.
    """

    shown: tuple[Demonstration, ...]
    recorded: tuple[Demonstration, ...]
    aligned: bool = False
    hands: tuple[RecordedHand, ...] = ()

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> "Demonstrations":
        """The recordings' demonstrations."""
        recorded = demonstrated(recordings)
        aligned = bool(recordings) and recordings[0].rule.aligned
        return cls(agreeing(recorded) if aligned else recorded, recorded, aligned)

    def only(self, names: Collection[str]) -> "Demonstrations":
        """The same with these of their objects."""
        shown, recorded = (tuple(item.only(names) for item in items) for items in (self.shown, self.recorded))
        return replace(self, shown=shown, recorded=recorded)

    @cached_property
    def needed(self) -> frozenset[str]:
        """The names of the objects that a scene must have."""
        return Taught(self.recorded).needed

    @cached_property
    def plans(self) -> PlanChooser | None:
        """Chooses among their plans; None where their rows are not aligned."""
        return PlanChooser(self.recorded) if self.aligned else None


def hands_of(recordings: Sequence[Recording], shown: Sequence[Demonstration]) -> tuple[RecordedHand, ...]:
    """What the hand did in each recording; `shown` are their demonstrations as prompts have them."""
    hands = []
    for recording, demonstration in zip(recordings, shown, strict=True):
        kept_to = kept(recording.motion, demonstration.actions, recording.rule.delta_rad_s)
        hands.append(RecordedHand.of(recording.motion, demonstration, kept_to))
    return tuple(hands)


def read_compared(
    connection: Connection, task: str, ids: Sequence[str], settings: TaskSettings
) -> tuple[Compared, ...]:
    """The poses of the episodes' objects that came with images in which the objects were then found."""
    return tuple(
        pair
        for record in episodes.by_ids(connection, task, ids).values()
        for pair in settings.compared(
            map(ObjectQuery.from_json, record.given_objects), [item.pose() for item in record.objects]
        )
    )


def recordings_of(
    connection: Connection, records: Sequence[DemonstrationRecord], settings: TaskSettings
) -> list[Recording]:
    """The demonstrations of records as they were found, each with the motion that it was made from."""
    rule, recordings = settings.keyframes.keyframe_rule(), []
    trajectories = get_trajectories(connection, [record.id for record in records])
    found = stepwise(records, settings)
    for demonstration, record, trajectory in zip(found, records, trajectories, strict=True):
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        recordings.append(Recording(replace(demonstration, start=trajectory.action_at(0)), motion, rule))
    return folded(recordings) if settings.gripper_symmetry_deg else recordings


def stepwise(records: Sequence[DemonstrationRecord], settings: TaskSettings) -> tuple[Demonstration, ...]:
    """Each with its own keyframes and the objects that all have: what only some have does not matter to the task."""
    found = [canonical_demonstration(record.demonstration(), settings) for record in records]
    names = in_all([[pose.name for pose in demonstration.objects] for demonstration in found])
    return tuple(demonstration.only(names) for demonstration in found)


def canonical_demonstration(demonstration: Demonstration, settings: TaskSettings) -> Demonstration:
    """The demonstration as prompts show it: symmetric objects at their canonical yaw."""
    later = tuple(settings.canonical(objects) for objects in demonstration.later_objects)
    return replace(demonstration, objects=settings.canonical(demonstration.objects), later_objects=later)


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Those of the first scene's names that all scenes have."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()
