"""An instruction that words alone do not explain -> one that the task knows, if a chat model finds it there."""

import re
from collections.abc import Sequence

from app.llm.base import CompletionRequest, LanguageModel, LanguageModelError
from app.pipeline.prompt import Prompt

SYSTEM = (
    "You check instructions for a robot arm. The robot knows a list of instructions and nothing else. You get the list "
    "and what a person said, in any language. Reply with the number of the one instruction that the person asks for. "
    "Reply with none if the person asks for something else, for more, for less, if several could be meant, or if you "
    "are not sure: a robot that moves to the wrong thing is worse than one that asks. Reply with nothing else."
)
MAX_TOKENS = 8
TIMEOUT_S = 20.0
_NUMBER = re.compile(r"\s*(\d{1,4})\s*\.?\s*")


async def ask_meaning(
    model: LanguageModel, instruction: str, choices: Sequence[str], timeout_s: float = TIMEOUT_S
) -> str | None:
    """The one of `choices` that `instruction` means, as the model understands it.

    Returns:
        None if the model says none, says anything else, or does not answer: the instruction is then refused as it is.
    """
    if model.profile.style != "chat" or not choices:
        return None
    request = CompletionRequest(_prompt(instruction, choices), MAX_TOKENS, min(timeout_s, TIMEOUT_S))
    try:
        reply = await model.complete(request)
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
