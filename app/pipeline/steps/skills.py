"""The tasks that a sentence may use, and the objects of a scene that they were taught with."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from app.pipeline.order.clauses import ParsedClause
from app.pipeline.order.frames import Frame
from app.pipeline.order.order import Order
from app.pipeline.order.reading import FilledFrame, compounds
from app.pipeline.order.roles import strangers
from app.pipeline.order.taught import TaughtWords

MAX_TASKS_LISTED = 10  # in a refusal
MAX_LISTED = 3  # instructions of a task, and meanings of a sentence, that a refusal repeats


class PlanStep(NamedTuple):
    """The instruction of one task, in the words that it was taught."""

    task: str
    instruction: str


@dataclass(frozen=True, eq=False)
class Skill:
    """A task and what it was taught."""

    task: str
    taught: TaughtWords

    @cached_property
    def wholes(self) -> tuple[str, ...]:
        """The taught instructions that must be said as a whole: of several clauses, or without a parse."""
        alone = {frame.text for frame in self.taught.frames if frame.may_stand_alone}
        return tuple(text for text in self.taught.instructions if text not in alone)

    def literal(self, said: str) -> tuple[PlanStep, bool] | None:
        """Return the step of a taught text, see `TaughtWords.literal`, and whether it is known as a whole only."""
        if (order := self.taught.literal(said)) is None or self._has_strangers(said):
            return None
        wholes = {Order(text, self.taught.names).form for text in self.wholes}
        return PlanStep(self.task, said.rstrip(". ")), order.form in wholes

    def steps(self, clause: ParsedClause) -> Iterator[tuple[FilledFrame, PlanStep]]:
        """Yield what the task may do for a clause, with objects or kinds of objects that were taught in these roles."""
        names, asked = self.taught.names, {phrase.name for phrase in clause.phrases}
        for frame in self.taught.frames if asked <= set(names) else ():
            named = asked or not frame.clause.phrases
            filled = frame.filled(clause, names) if frame.may_stand_alone and named else None
            text = frame.text_for(filled, names) if filled is not None else ""
            if text and filled and not self._has_strangers(text):
                yield FilledFrame(frame, filled, clause), PlanStep(self.task, text.rstrip(". "))

    def whole(self, clauses: Sequence[ParsedClause]) -> Iterator[PlanStep]:
        """Yield the taught instructions of several clauses that these clauses ask for, with objects as in `steps`."""
        if {phrase.name for clause in clauses for phrase in clause.phrases} <= set(self.taught.names):
            for text in compounds(self.taught, clauses):
                if not self._has_strangers(text):
                    yield PlanStep(self.task, text.rstrip(". "))

    def _has_strangers(self, text: str) -> bool:
        return any(strangers(Order(text, self.taught.names), self.taught.instructions))


class TasksOfScene(TaughtWords):
    """The objects of a scene, and what the tasks with these objects were taught.

    Args:
        names, aliases: of all objects, with or without a task.
        skills: the tasks.
    """

    def __init__(self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], skills: Sequence[Skill]) -> None:
        super().__init__(names, aliases, [text for skill in skills for text in skill.taught.instructions])
        self.skills = tuple(skills)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """The frames of each task, parsed among its own objects."""
        return tuple(frame for skill in self.skills for frame in skill.taught.frames)


def tasks_nearest_to(instruction: str, usable: Sequence[Skill], others: Mapping[Skill, str]) -> str:
    """Return a list of at most `MAX_TASKS_LISTED` tasks, those that share most words with the instruction first.

    Args:
        others: tasks that cannot be used, and why.
    """
    said = _words(instruction)

    def shared(skill: Skill) -> float:
        taught = (_words(f"{skill.task} {text}") for text in skill.taught.instructions)
        return max((len(said & words) / len(said | words) for words in taught), default=0.0)

    nearest = sorted((*usable, *others), key=shared, reverse=True)
    shown = nearest[:MAX_TASKS_LISTED]
    parts = [f"{skill.task}: {_listed(skill.taught.instructions)}" for skill in shown if skill not in others]
    if unlike := [f"{skill.task} ({others[skill]})" for skill in shown if skill in others]:
        parts.append(f"not with these objects: {'; '.join(unlike)}")
    if more := len(nearest) - len(shown):
        parts.append(f"and {more} more task{'s' * (more > 1)}")
    return "; ".join(parts)


def _words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", text.lower()))


def _listed(texts: Sequence[str]) -> str:
    more = f" and {len(texts) - MAX_LISTED} more" if texts[MAX_LISTED:] else ""
    return ", ".join(map(repr, texts[:MAX_LISTED])) + more
