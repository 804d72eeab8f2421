"""Closed loop: observation and action in turn, one call a step (paper, section V "Open-loop vs. closed-loop").

A demonstration shows the objects before each action, and once more after the last, where the reply is `done`::

    A cube 40 41 17; B base 60 41 17; stack them > 1 A w: +0 +0 +14 0 36 36 1
    A cube 40 41 17; B base 60 41 17; stack them > 2 A w: +0 +0 +0 0 36 36 0
    ...
    A cube 60 41 21; B base 60 41 17; stack them > done

Each step has a representation of its own, fitted to that step of every demonstration.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.prompt import PromptTemplate, rotated_in_all
from app.pipeline.representation.base import Codec, Decoder
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

DONE = "done"
FitStep = Callable[[Sequence[Demonstration], int], Codec]


@dataclass(frozen=True, eq=False)
class StepCodec(Codec):
    """One step of a closed loop: a reply is one action or `done`, which is no JSON.

    Attributes:
        action: for replies that are an action; None where every demonstration is done.
        observation: for observations.
    """

    action: Codec | None
    observation: Codec

    @property
    def stop(self) -> tuple[str, ...]:
        return self.observation.stop

    @property
    def separator(self) -> str:
        return self.observation.separator

    def needed(self) -> tuple[Demonstration, ...]:
        return self.observation.needed()

    def observation_text(self, query: Query) -> str:
        return self.observation.observation_text(query)

    def actions_text(self, demonstration: Demonstration) -> str:
        return self.action.actions_text(demonstration) if self.action and demonstration.actions else DONE

    def demonstration_text(self, demonstration: Demonstration) -> str:
        if self.action and demonstration.actions:
            return self.action.demonstration_text(demonstration)
        return f"{self.observation_text(demonstration)} {DONE}{self.separator}"

    def grammar(self, query: Query, max_actions: int) -> str:
        ending = "\\n" if "\n" in self.separator else ""
        done = f'" {DONE}{ending}"'
        if self.action is None:
            return f"root ::= {done}\n"
        actions = self.action.grammar(query, 1).replace("root ::=", "action ::=", 1)
        return f"root ::= {done} | action\n{actions}"

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        if complete and reply_text.strip() == DONE:
            return []
        if self.action is None:
            if complete:
                raise ReplyParseError(f"no demonstration has an action here, expected {DONE!r}", reply_text)
            return []
        return self.action.rows(reply_text, complete)

    def reply_text(self, rows: Sequence[str]) -> str:
        return self.action.reply_text(rows) if self.action and rows else f" {DONE}"

    def decoder(self, query: Query) -> Decoder:
        return _no_actions if self.action is None else self.action.decoder(query)


def _no_actions(first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
    """Of a step after the last action: `StepCodec.rows` lets nothing but `DONE` pass."""
    return []


@dataclass(frozen=True, eq=False)
class ClosedLoopTemplate:
    """The demonstrations of a closed loop, and a representation for each step.

    Attributes:
        steps: as many as the longest demonstration has actions, and one for what follows its last.
        rotated: of each step, the objects whose rotation all demonstrations have there.
    """

    steps: tuple[StepCodec, ...]
    system: str
    prefix: str
    rotated: tuple[frozenset[str], ...]

    @classmethod
    def write(cls, fit: FitStep, demonstrations: Sequence[Demonstration], system: str) -> "ClosedLoopTemplate":
        """The demonstrations in their order, each as its steps in turn.

        Args:
            fit: the representation of a step (from 0), given what the demonstrations show of it.

        Raises:
            InvalidInputError: if a demonstration did not track its objects.
        """
        stepwise = [_steps(demonstration) for demonstration in demonstrations]
        by_step = [[step for step in steps if step is not None] for steps in zip_longest(*stepwise)]
        codecs = tuple(_step_codec(fit, shown, k) for k, shown in enumerate(by_step))
        texts = [codecs[k].demonstration_text(step) for steps in stepwise for k, step in enumerate(steps)]
        return cls(codecs, system, "".join(texts), tuple(map(rotated_in_all, by_step)))

    def at_step(self, step: int) -> PromptTemplate:
        """The template that asks for the action of a step, from 0."""
        place = min(step, len(self.steps) - 1)
        return PromptTemplate(self.steps[place], self.system, self.prefix, self.rotated[place])


def _step_codec(fit: FitStep, shown: Sequence[Demonstration], step: int) -> StepCodec:
    acting = [demonstration for demonstration in shown if demonstration.actions]
    return StepCodec(fit(acting, step) if acting else None, fit(shown, step))


def _steps(demonstration: Demonstration) -> list[Demonstration]:
    """Each action as a demonstration of its own, and a last one without."""
    if len(demonstration.later_objects) != len(demonstration.actions):
        message = f"episode {demonstration.id} has no object poses after its first frame"
        raise InvalidInputError("closed_loop", message, "episodes whose trajectory has object_positions")
    observed = (demonstration.objects, *demonstration.later_objects)
    actions = [*((action,) for action in demonstration.actions), ()]
    pairs = zip(observed, actions, strict=True)
    return [replace(demonstration, objects=seen, actions=done, later_objects=()) for seen, done in pairs]
