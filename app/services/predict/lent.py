"""Demonstrations that other tasks lend to one that has none: which tasks, how many of each, and as they are read.

After X-ICM ("Exploring the Limits of Vision-Language-Action Manipulations in Cross-task Generalization", arXiv
2505.15660). Tasks are named by the request, or found by the words of instructions and objects.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.pipeline.episode import Demonstration
from app.pipeline.order.similarity import Described, most_similar
from app.services.predict.request import MAX_OTHER_TASKS, SIMILAR, PredictRequest
from app.services.predict.select import DemonstrationSelector, read_demonstrations
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.errors import ForbiddenTaskError, NotFoundError
from app.store.records import TaskRecord
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose

LISTED = 12  # tasks that a refusal names
FIELD = "demonstrations_from"


@dataclass(frozen=True, eq=False)
class LendingTask:
    """A task that lends demonstrations, and the ids of those."""

    record: TaskRecord
    ids: tuple[str, ...]


def lending_tasks(
    connection: Connection, request: PredictRequest, task: TaskRecord, number: int, select: DemonstrationSelector
) -> tuple[LendingTask, ...]:
    """The tasks that the request names or that are similar, the last of them shown last.

    Args:
        task: the one that is asked for.
        number: of demonstrations, of all tasks together.

    Raises:
        InvalidInputError: for a task that there is not or that has no episode, for fewer demonstrations than tasks, or
            if there is no other task.
        ForbiddenTaskError: for a task that the key is not for.
    """
    options = request.options
    names = _names(connection, request, task)
    lending = [_lending(connection, task, name, place) for place, name in enumerate(names)]
    if number < len(lending):
        message = f"is {number}, but demonstrations come from {len(lending)} tasks"
        raise InvalidInputError("num_demonstrations", message, f"{len(lending)} or more, or fewer tasks")
    return tuple(
        LendingTask(record, select(connection, record, options.selection, share, options.seed, ()))
        for record, share in zip(lending, shares(number, len(lending)), strict=True)
    )


def shares(number: int, num_tasks: int) -> list[int]:
    """How many demonstrations each task lends: equally many, those that are left over of the last tasks."""
    each, left_over = divmod(number, num_tasks)
    return [each + (place >= num_tasks - left_over) for place in range(num_tasks)]


def read_lent(
    connection: Connection, lending: Sequence[LendingTask], task: TaskRecord, settings: TaskSettings
) -> dict[str, tuple[Demonstration, ...]]:
    """What a prompt shows of each task, read with that task's settings.

    Args:
        settings: of `task`, the one that is asked for, in whose workspace everything must lie.

    Raises:
        InvalidInputError: if a demonstration leaves the workspace, so that its numbers would be wrong.
    """
    shown: dict[str, tuple[Demonstration, ...]] = {}
    for place, other in enumerate(lending):
        own = TaskSettings.model_validate(other.record.settings)
        read = read_demonstrations(connection, other.record.name, other.ids, own).shown
        _check_inside(read, f"{FIELD}[{place}]", other.record.name, task.name, settings)
        shown[other.record.name] = read
    return shown


def _names(connection: Connection, request: PredictRequest, task: TaskRecord) -> tuple[str, ...]:
    named = request.options.demonstrations_from
    if named is not None and named != SIMILAR:
        return named
    newest = episodes.newest_by_task(connection)
    described = [
        (name, Described(episode.instruction, tuple(item.name for item in episode.objects)))
        for name, episode in sorted(newest.items())
        if name != task.name
    ]
    if not described:
        raise InvalidInputError(FIELD, f"is {SIMILAR!r}, but no other task has episodes", "no demonstrations_from")
    asked = Described(request.instruction, tuple(query.name for query in request.objects))
    return most_similar(asked, described)


def _lending(connection: Connection, task: TaskRecord, name: str, place: int) -> TaskRecord:
    """The task of that name, if it has episodes."""
    try:
        record = tasks.get(connection, name)
    except NotFoundError:
        raise _cannot_lend(connection, task, place, f"there is no task {name!r}") from None
    except ForbiddenTaskError as error:
        raise ForbiddenTaskError(name, error.allowed, f"{FIELD}[{place}]") from None
    if record.object_names is None:
        raise _cannot_lend(connection, task, place, f"the task {name!r} has no episodes")
    return record


def _cannot_lend(connection: Connection, task: TaskRecord, place: int, message: str) -> InvalidInputError:
    listed = sorted(name for name in episodes.newest_by_task(connection) if name != task.name)
    more = f" and {len(listed) - LISTED} more" if len(listed) > LISTED else ""
    valid = f"tasks with episodes: {', '.join(listed[:LISTED])}{more}" if listed else "a task with episodes; none has"
    return InvalidInputError(f"{FIELD}[{place}]", message, f"{valid} (at most {MAX_OTHER_TASKS})")


def _check_inside(shown: Sequence[Demonstration], field: str, name: str, asked: str, settings: TaskSettings) -> None:
    workspace = settings.workspace.workspace()
    poses: list[ObjectPose] = [pose for demonstration in shown for pose in demonstration.objects]
    places_m = [pose.position_m for pose in poses] + [action.position_m for item in shown for action in item.actions]
    outside = next((place_m for place_m in places_m if not workspace.contains(place_m)), None)
    if outside is not None:
        box = f"{workspace.min_m.tolist()} to {workspace.max_m.tolist()}"
        reached = f"demonstrations of {name!r} reach {outside.round(3).tolist()} m"
        message = f"{reached}, outside of the workspace of {asked!r}, {box}"
        raise InvalidInputError(field, message, f"PUT /tasks/{asked} with a workspace that holds them")
