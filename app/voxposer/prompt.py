"""The one prompt of the baseline, the same for every task, and the program in a reply.

The published method asks a chain of language models: one splits the instruction, one composes value maps, one writes
each kind of map. Here one reply does all three, in a program of the same kinds of steps. `functions.txt` has what it
may call, `examples.txt` worked examples, of tasks that no evaluation here has.
"""

import json
import re
from dataclasses import dataclass
from importlib.resources import files

from app.pipeline.episode import Query
from app.pipeline.prompt import Prompt
from app.voxposer.errors import ProgramRefusedError


def _text(name: str) -> str:
    return (files("app.voxposer") / name).read_text(encoding="utf-8")


SYSTEM = (
    "You control a robot arm with a parallel gripper. For a task and the objects in the scene you write a short "
    "program in a small part of Python that paints 3D value maps and moves the gripper by them. Reply with the "
    f"program alone.\n\n{_text('functions.txt')}"
)
STOP = ("\n# objects:", "\n# task:")
_FENCED = re.compile(r"```(?:python|py)?[ \t]*\n(.*?)```", re.DOTALL)


@dataclass(frozen=True)
class ProgramTemplate:
    """All of the prompt that does not depend on the query.

    Attributes:
        system: the system prompt.
        prefix: functions and examples.
    """

    system: str
    prefix: str

    def ask(self, query: Query, max_actions: int, so_far: str = "") -> Prompt:
        """The prompt that asks for a program; its arguments are those of `PromptTemplate.ask`."""
        names = ", ".join(json.dumps(pose.name, ensure_ascii=False) for pose in query.objects)
        return Prompt(self.system, self.prefix, f"{so_far}# objects: {names}\n# task: {query.instruction}\n", STOP)


PROGRAM_TEMPLATE = ProgramTemplate(SYSTEM, _text("examples.txt"))


def program_of(reply_text: str) -> str:
    """The program in a reply: all of it, or what stands in its only ``` fence.

    Raises:
        ProgramRefusedError: if there are several fences, or one that does not end.
    """
    if "```" not in reply_text:
        return reply_text
    fenced = _FENCED.findall(reply_text)
    if len(fenced) != 1 or reply_text.count("```") != 2:
        raise ProgramRefusedError("the reply is not one program (valid: the program alone, or in one ``` fence)")
    return str(fenced[0])
