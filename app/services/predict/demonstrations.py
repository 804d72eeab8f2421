"""Stored episodes -> demonstrations with rows aligned within each plan -> the prefix of a prompt."""

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import attrgetter

from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.episode import Demonstration
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.frames import Compared
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.path_kept import kept
from app.pipeline.findings.yaw import Rotations
from app.pipeline.groups import by_plan, made_by_group
from app.pipeline.plans import agreeing, demonstrated
from app.pipeline.plans.choice import PlanChooser
from app.pipeline.plans.recording import Recording, alike_turned
from app.pipeline.plans.support import Support
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec
from app.pipeline.workspace import Workspace
from app.services.compared import compared
from app.services.predict.request import PromptStyle
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import DemonstrationRecord
from app.store.trajectories import get_trajectories

MAX_PREFIXES = 256


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Some of a task's demonstrations.

    Attributes:
        shown: as prompts show them, with rows of one plan at their robust center.
        recorded: the same with rows as they were recorded.
        aligned: whether demonstrations of one plan have equally many rows.
        hands: the hand's recorded path for each; empty where it is not needed.
    """

    shown: tuple[Demonstration, ...]
    recorded: tuple[Demonstration, ...]
    aligned: bool = False
    hands: tuple[RecordedHand, ...] = ()

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> "Demonstrations":
        recorded = demonstrated(recordings)
        aligned = bool(recordings) and recordings[0].rule.aligned
        return cls(agreeing(recorded) if aligned else recorded, recorded, aligned)

    def only(self, names: Collection[str]) -> "Demonstrations":
        """Return the same without their other objects."""
        shown, recorded = (tuple(item.only(names) for item in items) for items in (self.shown, self.recorded))
        return replace(self, shown=shown, recorded=recorded)

    @cached_property
    def needed(self) -> frozenset[str]:
        """The names of the objects that a scene must have."""
        return Taught(self.recorded).needed

    @cached_property
    def plans(self) -> PlanChooser | None:
        """The chooser among their plans; None if rows are not aligned."""
        return PlanChooser(self.recorded) if self.aligned else None


def hands_of(recordings: Sequence[Recording], shown: Sequence[Demonstration]) -> tuple[RecordedHand, ...]:
    """Return the hand's path in each recording; `shown` are its demonstrations as prompts have them."""
    hands = []
    for recording, demonstration in zip(recordings, shown, strict=True):
        kept_to = kept(recording.motion, demonstration.actions, recording.rule.delta_rad_s)
        hands.append(RecordedHand.of(recording.motion, demonstration, kept_to))
    return tuple(hands)


def read_compared(
    connection: Connection, task: str, ids: Sequence[str], settings: TaskSettings
) -> tuple[Compared, ...]:
    """Return the objects' uploaded poses paired with the poses found in the same episodes' images."""
    return tuple(
        pair
        for record in episodes.by_ids(connection, task, ids).values()
        for pair in compared(
            map(ObjectQuery.from_json, record.given_objects), [item.pose() for item in record.objects], settings
        )
    )


def read_rotations(connection: Connection, task: str, ids: Sequence[str], settings: TaskSettings) -> Rotations:
    """Return the rotations of objects with a declared yaw symmetry, as they were before it was applied."""
    records = episodes.demonstrations_by_id(connection, task, ids) if settings.yaw_symmetry_deg else ()
    return {
        record.id: {
            pose.name: pose.quaternion_xyzw
            for pose in record.demonstration().objects
            if pose.name in settings.yaw_symmetry_deg and pose.quaternion_xyzw is not None
        }
        for record in records
    }


def recordings_of(
    connection: Connection, records: Sequence[DemonstrationRecord], settings: TaskSettings
) -> Sequence[Recording]:
    """Return each record's demonstration with the motion of its trajectory; objects that not all have are left out."""
    rule, recordings = settings.keyframes.keyframe_rule(), []
    trajectories = get_trajectories(connection, [record.id for record in records])
    stored = [record.demonstration() for record in records]
    found = [replace(item, objects=settings.canonical(item.objects)) for item in stored]
    names = in_all([[pose.name for pose in demonstration.objects] for demonstration in found])
    for demonstration, record, trajectory in zip(found, records, trajectories, strict=True):
        motion = settings.motion_of(trajectory, record.control_frequency_hz)
        recordings.append(Recording(replace(demonstration.only(names), start=trajectory.action_at(0)), motion, rule))
    if not settings.gripper_symmetry_deg:
        return recordings
    return made_by_group(recordings, attrgetter("demonstration.order.form"), alike_turned)


def in_all(names: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names that all scenes have, in the first scene's order."""
    return tuple(name for name in names[0] if all(name in others for others in names)) if names else ()


@dataclass(frozen=True, eq=False)
class Prefix:
    """The system prompt and the demonstrations as text, with what replies are checked against.

    Attributes:
        template: has the text, and writes queries.
        demonstration_ids: in the order of the prompt.
        support: checks actions against the demonstrated plans.
        instructions: of the demonstrations.
    """

    template: PromptTemplate
    demonstration_ids: tuple[str, ...]
    support: Support
    instructions: tuple[str, ...]

    @cached_property
    def cache_key(self) -> str:
        """A digest of the prompt up to the query."""
        return hashlib.sha256(f"{self.template.system}\0{self.template.prefix}".encode()).hexdigest()[:16]


def usual_prefixes(demonstrations: Demonstrations, settings: TaskSettings, style: PromptStyle) -> list[Prefix]:
    """Return the prefixes of the most frequent plans, the most frequent first."""
    workspace, plans = settings.workspace.workspace(), demonstrations.plans
    choices = [None] if plans is None else [choice.shown for choice in plans.likely()]
    return [write_prefix(demonstrations, workspace, style, shown) for shown in choices]


@lru_cache(MAX_PREFIXES)
def write_prefix(
    demonstrations: Demonstrations,
    workspace: Workspace,
    style: PromptStyle,
    of_scene: tuple[Demonstration, ...] | None,
    absent: tuple[str, ...] = (),
) -> Prefix:
    """Fit the representation and write the demonstrations. The text depends on the arguments alone, byte for byte.

    Args:
        of_scene: the recorded demonstrations of the plans that the scene calls for; None: all.
        absent: objects of the task that the scene lacks.

    Raises:
        InvalidInputError: without demonstrations.
    """
    recorded = demonstrations.recorded if of_scene is None else of_scene
    shown = demonstrations.shown if of_scene is None else agreeing(of_scene)
    shown, recorded = (
        tuple(_as_asked(item, absent, style.from_start) for item in items) for items in (shown, recorded)
    )
    codec = fit_codec(style.representation, style.prompt_format, shown, workspace)
    return Prefix(
        PromptTemplate.write(codec, shown, system_prompt_text(style.system_prompt)),
        tuple(item.id for item in shown),
        Support.of(by_plan(recorded), by_plan(shown)),
        tuple(item.instruction for item in shown),
    )


def _as_asked(demonstration: Demonstration, absent: Collection[str], from_start: bool) -> Demonstration:
    """Return the demonstration without absent objects, and without the start pose if the request has none."""
    present = demonstration.only([pose.name for pose in demonstration.objects if pose.name not in absent])
    return present if from_start else replace(present, start=None)
