"""Stored episodes -> the demonstrations of a prompt: with the task's symmetries, and as plans whose rows agree."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sqlalchemy import Connection

from app.pipeline.episode import Demonstration, Trajectory
from app.pipeline.keyframes import KeyframeRule
from app.pipeline.plans import Recording, agreeing, aligned_by_plan, by_plan, shown_together
from app.pipeline.timeline import frame_times_s
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """The demonstrations of one prompt.

    Attributes:
        shown: as the prompt shows them.
        recorded: the same as they were recorded, before rows of one plan were made to agree.
    """

    shown: tuple[Demonstration, ...]
    recorded: tuple[Demonstration, ...]

    @property
    def groups(self) -> list[tuple[Demonstration, ...]]:
        """The recorded ones of each instruction and plan."""
        return by_plan(self.recorded)


def read_demonstrations(
    connection: Connection, task: str, ids: Sequence[str], settings: TaskSettings, *, all_of_them: bool = False
) -> Demonstrations:
    """The demonstrations of the named episodes.

    Args:
        all_of_them: also those of a rare plan, which a prompt otherwise leaves out.

    Raises:
        NotFoundError: naming the first id that is no episode of this task.
    """
    records = episodes.demonstrations_by_id(connection, task, ids)

    def trajectories() -> tuple[Trajectory, ...]:
        return episodes.get_trajectories(connection, ids)

    return demonstrations_of(records, trajectories, settings, all_of_them=all_of_them)


def demonstrations_of(
    records: Sequence[DemonstrationRecord],
    trajectories: Callable[[], Sequence[Trajectory]],
    settings: TaskSettings,
    *,
    all_of_them: bool = False,
) -> Demonstrations:
    """The demonstrations of records.

    Args:
        trajectories: reads those of the records, in their order; called where the task's keyframe rule needs them.
    """
    if not settings.keyframes.keyframe_rule().aligned:
        canonical = tuple(canonical_demonstration(record.demonstration(), settings) for record in records)
        return Demonstrations(canonical, canonical)
    recorded = aligned_by_plan(recordings_of(records, trajectories(), settings))
    if not all_of_them:
        recorded = shown_together(recorded)
    return Demonstrations(agreeing(recorded), recorded)


def recordings_of(
    records: Sequence[DemonstrationRecord], trajectories: Sequence[Trajectory], settings: TaskSettings
) -> list[Recording]:
    """The demonstrations of records as they were found, each with the trajectory that it was made from."""
    rule = settings.keyframes.keyframe_rule()
    return [
        _recording(canonical_demonstration(record.demonstration(), settings), trajectory, record, rule)
        for record, trajectory in zip(records, trajectories, strict=True)
    ]


def stepwise_demonstrations(records: Sequence[DemonstrationRecord], settings: TaskSettings) -> Demonstrations:
    """The demonstrations of a closed loop, each with its own keyframes: the objects were tracked to these."""
    canonical = tuple(canonical_demonstration(record.demonstration(), settings) for record in records)
    return Demonstrations(canonical, canonical)


def canonical_demonstration(demonstration: Demonstration, settings: TaskSettings) -> Demonstration:
    """The demonstration as prompts show it: symmetric objects at their canonical yaw."""
    later = tuple(settings.canonical(objects) for objects in demonstration.later_objects)
    return replace(demonstration, objects=settings.canonical(demonstration.objects), later_objects=later)


def _recording(
    demonstration: Demonstration, trajectory: Trajectory, record: DemonstrationRecord, rule: KeyframeRule
) -> Recording:
    started = replace(demonstration, start=trajectory.action_at(0))
    return Recording(started, trajectory, frame_times_s(trajectory, record.control_frequency_hz), rule)
