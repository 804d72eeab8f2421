"""A task as one transaction reads it: its settings, its demonstrations, and what is made of them once a version."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection

from app.pipeline.findings.demonstrations import Taught
from app.pipeline.plans import Recording, agreeing
from app.pipeline.plans.choice import PlanChoice, PlanChooser
from app.pipeline.prompt import check_object_names
from app.services.cache import Cache
from app.services.errors import NoDemonstrationsError
from app.services.predict.demonstrations import Demonstrations, hands_of, read_compared, read_recordings, read_stepwise
from app.services.predict.prefix import Prefix, make_prefix
from app.services.predict.request import PromptStyle, Selection
from app.services.predict.select import Scenes, most_diverse, nearest_last, read_scenes
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose

MAX_HELD_AGAINST = 50  # demonstrations of a task

# Name, when it was made and version: one that was deleted and made again counts its versions from the beginning.
TaskState = tuple[str, datetime, int]
Ids = tuple[str, ...]
# What a prefix depends on: nothing else may change its bytes.
PrefixKey = tuple[TaskState, PromptStyle, Ids, bool, Ids, Ids]


@dataclass(frozen=True, eq=False)
class Kept:
    """What was made of tasks, the most recently used; nothing in it depends on an observed scene or on words."""

    settings: Cache[TaskState, TaskSettings] = field(default_factory=lambda: Cache(128))
    scenes: Cache[TaskState, Scenes] = field(default_factory=lambda: Cache(64))  # 10,000 of three objects take 1 MB
    chosen: Cache[tuple[TaskState, Selection, int, int], Ids] = field(default_factory=lambda: Cache(1024))
    demonstrations: Cache[tuple[TaskState, Ids], Demonstrations] = field(default_factory=lambda: Cache(16))
    taught: Cache[tuple[TaskState, bool, bool], Taught] = field(default_factory=lambda: Cache(128))
    needed: Cache[tuple[TaskState, Ids], frozenset[str]] = field(default_factory=lambda: Cache(128))
    plans: Cache[tuple[TaskState, Ids], PlanChooser] = field(default_factory=lambda: Cache(128))
    prefixes: Cache[PrefixKey, Prefix] = field(default_factory=lambda: Cache(256))


class TaskReading:
    """A task in the transaction of `connection`.

    Attributes:
        record: as it is stored.
        settings: of the task.

    Raises:
        NotFoundError: if there is no such task.
    """

    def __init__(self, connection: Connection, name: str, kept: Kept) -> None:
        self.record: TaskRecord = tasks.get(connection, name)
        self._connection, self._kept = connection, kept
        self._state: TaskState = (name, self.record.created_at, self.record.version)
        self.settings = kept.settings.get_or_make(
            self._state, lambda: TaskSettings.model_validate(self.record.settings)
        )

    def ids(self, selection: Selection, number: int, seed: int, objects: Sequence[ObjectPose]) -> Ids:
        """The ids of at most `number` episodes of the task.

        Args:
            selection: `first` and `recent` by time of upload; `random` by `seed`; `nearest` by the distance of the
                observed `objects` to the episode's, the nearest last, where a language model heeds it most; `diverse`
                those whose objects stand farthest apart, oldest first.
        """
        if selection == "nearest":
            scenes = self._scenes
            return scenes.ids_at(nearest_last(*scenes.with_objects(objects), number))
        key = (self._state, selection, number, seed if selection == "random" else 0)
        return self._kept.chosen.get_or_make(key, lambda: self._chosen(selection, number, seed))

    def refuse_left_out(self, ids: Sequence[str]) -> None:
        """Refuse episodes that no prompt is to show.

        Raises:
            InvalidInputError: naming the first.
        """
        left_out = episodes.left_out_of(self._connection, ids)
        for number, id_ in enumerate(ids):
            if id_ in left_out:
                remedy = f'others, or PATCH /episodes/{id_} with {{"left_out": false}}'
                raise InvalidInputError(f"episode_ids[{number}]", f"{id_} is left out of prompts", remedy)

    def plans(self, ids: Ids) -> PlanChooser | None:
        """Chooses among the plans of these demonstrations; None where their rows are not aligned."""
        if not self.settings.keyframes.keyframe_rule().aligned:
            return None
        return self._kept.plans.get_or_make((self._state, ids), lambda: PlanChooser(self._demonstrations(ids).recorded))

    def prefix(
        self,
        style: PromptStyle,
        ids: Ids,
        choice: PlanChoice | None = None,
        absent: Ids = (),
        *,
        all_of_them: bool = False,
    ) -> Prefix:
        """The demonstrations of those ids, written down.

        Args:
            choice: those of them that the scene calls for.
            absent: objects of the task that the scene does not have.
            all_of_them: also those of a rare plan.
        """
        shown_ids = () if choice is None else tuple(demonstration.id for demonstration in choice.shown)

        def make() -> Prefix:
            if choice is not None:
                shown = Demonstrations(agreeing(choice.shown), choice.shown)
            elif style.closed_loop:
                own = read_stepwise(self._connection, self.record.name, ids, self.settings)
                shown = Demonstrations(own, own)
            else:
                shown = self._demonstrations(ids)
                if self.settings.keyframes.keyframe_rule().aligned and not all_of_them:
                    shown = shown.without_rare_plans()
            shown = shown.only(set(self._object_names).difference(absent))
            return make_prefix(shown.shown, shown.recorded, self.settings.workspace.workspace(), style)

        return self._kept.prefixes.get_or_make((self._state, style, ids, all_of_them, shown_ids, absent), make)

    def taught(self, style: PromptStyle) -> Taught:
        """All demonstrations of the task, whichever a request names; of very many those that lie farthest apart.

        Those that a program names may be of one way by chance: the service cannot know that a person chose them.

        Raises:
            NoDemonstrationsError: if there is none, or all are left out.
        """

        def make() -> Taught:
            if not (ids := self.ids("diverse", MAX_HELD_AGAINST, 0, ())):
                raise NoDemonstrationsError(self.record.name)
            recordings = self._recordings(ids)
            recorded = self._kept.demonstrations.get_or_make((self._state, ids), lambda: self._of(recordings)).recorded
            hands = hands_of(recordings, recorded)
            if not style.from_start:
                recorded = tuple(replace(demonstration, start=None) for demonstration in recorded)
            several, round_objects = self.settings.ways == "several", frozenset(self.settings.yaw_symmetry_deg)
            compared = read_compared(self._connection, self.record.name, ids, self.settings)
            return Taught(recorded, several, hands, round_objects, moves=style.closed_loop, compared=compared)

        return self._kept.taught.get_or_make((self._state, style.from_start, style.closed_loop), make)

    def taught_of(self, present: Sequence[str], taught: Taught, ids: Ids) -> Taught:
        """What is taught of scenes that have only these of the task's objects.

        Args:
            ids: of the demonstrations that the prompt shows.

        Raises:
            ObjectSetError: if another may matter to all that is taught, or to the demonstrations of those ids.
        """

        def needed() -> frozenset[str]:
            return taught.needed | Taught(self._demonstrations(ids).recorded).needed

        check_object_names(present, self._object_names, self._kept.needed.get_or_make((self._state, ids), needed))
        return taught.of_objects(present)

    @property
    def _object_names(self) -> Ids:
        return self.record.object_names or ()

    def _demonstrations(self, ids: Ids) -> Demonstrations:
        """Of those ids; a prompt and what its answer is held against are often made of the same."""
        return self._kept.demonstrations.get_or_make((self._state, ids), lambda: self._of(self._recordings(ids)))

    def _recordings(self, ids: Ids) -> list[Recording]:
        return read_recordings(self._connection, self.record.name, ids, self.settings)

    def _of(self, recordings: Sequence[Recording]) -> Demonstrations:
        return Demonstrations.of(recordings).only(self._object_names)

    def _chosen(self, selection: Selection, number: int, seed: int) -> Ids:
        name = self.record.name
        if selection == "random":
            ids = episodes.list_ids(self._connection, name)
            return tuple(random.Random(seed).sample(ids, min(number, len(ids))))
        if selection == "diverse":
            return self._scenes.ids_at(most_diverse(self._scenes.positions_m, number))
        order: Literal["first", "recent"] = "recent" if selection == "recent" else "first"
        return tuple(record.id for record in episodes.demonstrations(self._connection, name, number, order))

    @property
    def _scenes(self) -> Scenes:
        return self._kept.scenes.get_or_make(self._state, lambda: read_scenes(self._connection, self.record.name))
