"""Parse a sentence over several tasks against all tasks that the present key may use."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sqlalchemy import Connection

from app.perception.base import ObjectQuery
from app.pipeline.errors import ObjectSetError, UnfamiliarInstructionError
from app.pipeline.names import check_object_names, shared_aliases
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import MAX_KEPT, taught_words
from app.pipeline.steps.reading import read_steps
from app.pipeline.steps.skills import PlanStep, Skill, TasksOfScene, tasks_nearest_to
from app.services.cache import Cache
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskRecord, TaskState
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_instruction

MAX_SCENES = 16  # whose vocabularies over all tasks are kept


@dataclass(frozen=True, eq=False)
class _PlacedSkill:
    """A task with demonstrations, and its robot's base: x, y, z (m, world frame) and yaw (rad)."""

    skill: Skill
    robot_base: tuple[float, ...]

    def unlike(self, names: set[str], *, exactly: bool) -> str:
        """Return why the task does not fit a scene of these objects; empty if it does."""
        own = set(self.skill.taught.names)
        parts = {"not seen": own - names, "not of this task": names - own if exactly else ()}
        return ", ".join(f"{what}: {', '.join(sorted(which))}" for what, which in parts.items() if which)


class ReadSteps:
    """Reads sentences against all tasks that the present key may use. Synchronous: call it in a thread."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._known: Cache[TaskState, _PlacedSkill] = Cache(MAX_KEPT)
        self._scenes: Cache[tuple[tuple[str, ...], tuple[Skill, ...]], TasksOfScene] = Cache(MAX_SCENES)

    def __call__(
        self, instruction: str, objects: Sequence[ObjectQuery], *, exactly: bool = False
    ) -> tuple[PlanStep, ...]:
        """Return the steps that the instruction asks for, each in the words of its task.

        Args:
            objects: all of the scene.
            exactly: only of tasks that have all of these objects.

        Raises:
            InstructionError: if it is not clear.
            ObjectSetError: if two objects have one name, or no task is about these objects.
        """
        instruction = checked_instruction("instruction", instruction)
        names = tuple(item.name for item in objects)
        check_object_names(names, tuple(dict.fromkeys(names)))
        with self._store.read() as connection:
            known = [self._of(connection, task) for task in tasks.list_all(connection) if task.object_names is not None]
        reasons = {item.skill: item.unlike(set(names), exactly=exactly) for item in known}
        usable = [item for item in known if not reasons[item.skill]]
        others = {skill: why for skill, why in reasons.items() if why}
        if not usable:
            valid = tasks_nearest_to(instruction, (), others) or "POST /episodes teaches tasks"
            raise ObjectSetError("objects", "no task is about these objects", valid)
        skills = tuple(item.skill for item in usable)
        scene = self._scenes.get_or_make((names, skills), lambda: _scene(names, skills))
        return read_steps(instruction, scene, _layout(objects, usable), others)

    def with_task(self, request: PredictRequest) -> PredictRequest:
        """Return the request with the task that does what it asks for, among tasks of exactly its objects.

        Raises:
            as `__call__`; InvalidInputError if its options name episodes.
        """
        if request.options.episode_ids is not None:
            raise InvalidInputError("task", "is left out beside episode_ids", "the name of the task")
        steps = self(request.instruction, request.objects, exactly=True)
        names = list(dict.fromkeys(step.task for step in steps))
        if len(names) > 1:
            message = f"{request.instruction!r} asks for {', '.join(names)} one after the other"
            raise UnfamiliarInstructionError("instruction", message, "what one task does; POST /plans gives the steps")
        return replace(request, task=names[0])

    def _of(self, connection: Connection, task: TaskRecord) -> _PlacedSkill:
        """Return the task with the instructions that its prompts show."""

        def make() -> _PlacedSkill:
            settings = TaskSettings.model_validate(task.settings)
            shown = episodes.demonstrations(connection, task.name, settings.num_demonstrations)
            taught = dict.fromkeys(record.instruction for record in shown)
            aliases = tuple(sorted(settings.aliases.items()))
            skill = Skill(task.name, taught_words(tuple(task.object_names or ()), aliases, tuple(taught)))
            return _PlacedSkill(skill, (*settings.robot_base, math.radians(settings.robot_base_yaw_deg)))

        return self._known.get_or_make(task.state, make)


def _scene(names: Sequence[str], skills: Sequence[Skill]) -> TasksOfScene:
    return TasksOfScene(names, shared_aliases([skill.taught.aliases for skill in skills], names), skills)


def _layout(objects: Sequence[ObjectQuery], usable: Sequence[_PlacedSkill]) -> Layout | None:
    """Return the objects' positions from the robot's base; None if a position or the base is not known."""
    places_m = {item.name: np.array(item.position_m) for item in objects if item.position_m is not None}
    bases = {item.robot_base for item in usable}
    if len(places_m) < len(objects) or len(bases) != 1:
        return None
    *base_m, yaw_rad = bases.pop()
    return Layout(places_m, np.array(base_m), yaw_rad)
