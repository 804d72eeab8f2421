"""Parse an instruction against those of the demonstrations that the prompt shows.

Where the parser finds no meaning, a chat model may choose one of the instructions that the task knows.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from app.llm.base import CompletionRequest, LanguageModel, LanguageModelError, complete
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.pipeline.prompt import Prompt
from app.services.predict.request import PredictRequest
from app.services.task_settings import TaskSettings
from roboprompt_client.types.poses import ObjectPose

MAX_TASKS = 256  # whose vocabularies are kept: a task of 100 instructions takes 1 MB
SYSTEM = (
    "You check instructions for a robot arm. The robot knows a list of instructions and nothing else. You get the list "
    "and what a person said, in any language. Reply with the number of the one instruction that the person asks for. "
    "Reply with none if the person asks for something else, for more, for less, if several could be meant, or if you "
    "are not sure: a robot that moves to the wrong thing is worse than one that asks. Reply with nothing else."
)
MAX_TOKENS = 8
TIMEOUT_S = 20.0
_NUMBER = re.compile(r"\s*(\d{1,4})\s*\.?\s*")


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
    if request.meaning is not None:
        order = read(request.meaning, known)
        phrases = tuple(Grounding(request.instruction, phrase.object_name, "llm") for phrase in order.phrases)
        return replace(order, phrases=phrases)
    layout = settings.layout({pose.name: pose.position_m for pose in objects})
    return read(request.instruction, known, layout, allow_unfamiliar=request.options.unfamiliar == "allow")


@lru_cache(MAX_TASKS)
def taught_of(
    names: tuple[str, ...], aliases: tuple[tuple[str, tuple[str, ...]], ...], instructions: tuple[str, ...]
) -> TaughtWords:
    """Return what instructions about these objects are parsed against; cached, because robots repeat themselves."""
    return TaughtWords(names, dict(aliases), instructions)


async def ask_meaning(model: LanguageModel, instruction: str, choices: Sequence[str], timeout_s: float) -> str | None:
    """Ask the model which of `choices` the instruction means, for `TIMEOUT_S` at most.

    Returns:
        None if the model says "none" or anything else, or does not answer: the instruction is then refused.
    """
    if model.profile.style != "chat":
        return None
    request = CompletionRequest(_prompt(instruction, choices), MAX_TOKENS, min(timeout_s, TIMEOUT_S))
    try:
        reply = await complete(model, request)
    except LanguageModelError:
        return None
    number = _NUMBER.fullmatch(reply.text)
    place = int(number[1]) - 1 if number else -1
    return choices[place] if 0 <= place < len(choices) else None


def _prompt(instruction: str, choices: Sequence[str]) -> Prompt:
    listed = "\n".join(f"{number}. {choice}" for number, choice in enumerate(choices, start=1))
    numbers = [*map(str, range(1, len(choices) + 1)), "none"]
    grammar = "root ::= " + " | ".join(f'"{number}"' for number in numbers)
    # The person's words stand in quotation marks of their own: they are to be understood, not followed.
    said = instruction.replace('"', "'")
    return Prompt(SYSTEM, f"The robot knows:\n{listed}\n", f'The person said: "{said}"', ("\n",), grammar)
