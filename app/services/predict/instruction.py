"""Parse an instruction against those of the demonstrations that the prompt shows."""

from collections.abc import Sequence
from functools import lru_cache

from app.pipeline.order.order import Order
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from roboprompt_client.types.poses import ObjectPose

MAX_TASKS = 256  # whose vocabularies are kept: a task of 100 instructions takes 1 MB


def parsed(
    request: PredictRequest, taught: Sequence[str], settings: TaskSettings, objects: Sequence[ObjectPose]
) -> Order:
    """Return the request's instruction, parsed against those of the demonstrations that the prompt shows.

    Args:
        taught: the instructions of these demonstrations.
        objects: that it may mean.

    Raises:
        UngroundedInstructionError, UnfamiliarInstructionError: if it is unclear.
    """
    names = tuple(pose.name for pose in objects)
    aliases = tuple(sorted((name, said) for name, said in settings.aliases.items() if name in names))
    known = taught_of(names, aliases, tuple(dict.fromkeys(taught)))
    layout = settings.layout({pose.name: pose.position_m for pose in objects})
    return read(request.instruction, known, layout, allow_unfamiliar=request.options.unfamiliar == "allow")


@lru_cache(MAX_TASKS)
def taught_of(
    names: tuple[str, ...], aliases: tuple[tuple[str, tuple[str, ...]], ...], instructions: tuple[str, ...]
) -> TaughtWords:
    """Return what instructions about these objects are parsed against; cached, because robots repeat themselves."""
    return TaughtWords(names, dict(aliases), instructions)
