"""A request's instruction -> what it asks for, in the words of the demonstrations that the prompt shows."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from app.pipeline.episode import ObjectPose
from app.pipeline.language.grounding import Grounded, Grounding, Taught
from app.pipeline.language.space import Layout
from app.services.english import is_english
from app.services.previous_step import PreviousStep
from app.services.question import PredictRequest
from app.services.task_settings import TaskSettings

MAX_TASKS = 256  # whose words are kept: a task of 100 instructions takes 1 MB


def ground_instruction(
    request: PredictRequest,
    instruction: str,
    taught: Sequence[str],
    settings: TaskSettings,
    objects: Sequence[ObjectPose],
    previous: PreviousStep | None,
) -> Grounded:
    """The instruction as it is understood; a closed loop goes on with what its first step understood.

    The objects move while a closed loop runs: "the leftmost cube" must stay the one that it was.

    Args:
        taught: the instructions of the demonstrations that the prompt shows.
        objects: as they were observed, in the task's order.

    Raises:
        UngroundedInstructionError, UnfamiliarInstructionError: if it is not clear.
    """
    if previous is not None and previous.grounded is not None and previous.instruction == request.instruction:
        return previous.grounded
    aliases = tuple(sorted(settings.aliases.items()))
    words = _words(tuple(pose.name for pose in objects), aliases, tuple(dict.fromkeys(taught)))
    if request.meaning is not None:
        grounded = words.ground(request.meaning)
        phrases = tuple(Grounding(instruction, phrase.object_name, "llm") for phrase in grounded.phrases)
        return replace(grounded, phrases=phrases)
    layout = Layout({pose.name: pose.position_m for pose in objects}, np.array(settings.robot_base))
    return words.ground(instruction, layout, allow_unfamiliar=request.unfamiliar == "allow")


@lru_cache(MAX_TASKS)
def _words(names: tuple[str, ...], aliases: tuple[tuple[str, tuple[str, ...]], ...], taught: tuple[str, ...]) -> Taught:
    return Taught(names, dict(aliases), taught, is_english)
