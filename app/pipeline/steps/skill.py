"""Tasks as sentences about several of them are read against them, and what each does of them: its steps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from app.pipeline.findings.scene import strangers
from app.pipeline.order.clause_parser import ParsedClause
from app.pipeline.order.frames import Frame
from app.pipeline.order.order import Order
from app.pipeline.order.reading import Filled
from app.pipeline.order.taught import Taught
from app.pipeline.order.words import IsWord


class Step(NamedTuple):
    """What one task is to do, in its own words."""

    task: str
    instruction: str


@dataclass(frozen=True, eq=False)
class Skill:
    """A task as sentences are read against it."""

    task: str
    taught: Taught

    @cached_property
    def wholes(self) -> tuple[str, ...]:
        """The taught instructions that are understood as they stand only: of different clauses, or beyond grammar."""
        alone = {frame.text for frame in self.taught.frames if frame.may_stand_alone}
        return tuple(text for text in self.taught.instructions if text not in alone)

    def steps(self, clause: ParsedClause) -> Iterator[tuple[Filled, Step]]:
        """What the task may do for a clause: only with objects, or kinds of objects, that it was taught with so."""
        names, asked = self.taught.names, {phrase.name for phrase in clause.phrases}
        for frame in self.taught.frames if asked <= set(names) else ():
            named = asked or not frame.clause.phrases
            filled = frame.filled(clause, names) if frame.may_stand_alone and named else None
            text = None if filled is None else frame.text_for(filled, names)
            if text and filled and not any(strangers(Order(text, names), self.taught.instructions)):
                yield Filled(frame, filled, clause), Step(self.task, text.rstrip(". "))


class Scene(Taught):
    """The objects of a scene, and all that the tasks were taught that may be used in it.

    Args:
        names, aliases: of all objects, also of those that no task is about.
        skills: of these objects.
        is_word: as of `Taught`.
    """

    def __init__(
        self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], skills: Sequence[Skill], is_word: IsWord
    ) -> None:
        super().__init__(names, aliases, [text for skill in skills for text in skill.taught.instructions], is_word)
        self.skills = tuple(skills)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """As each task has them: what its instructions name is clear among its own objects."""
        return tuple(frame for skill in self.skills for frame in skill.taught.frames)
