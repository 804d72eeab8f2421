"""Several replies to one question at once, of which the prediction is a statistic."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import dataclass
from functools import reduce

import anyio

from app.llm.base import LanguageModel, TextDelta, Usage
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.plans.support import PlacedRow
from app.pipeline.prompt import Prompt
from app.pipeline.reply import consensus
from app.services.measures import Timings, timed
from app.services.predict.dialogue import Dialogue, usage_sum
from app.services.predict.question import Question
from app.store.values import JsonObject
from roboprompt_client.trajectory import EndEffectorAction


@dataclass(frozen=True)
class _Reply:
    """One sample: its actions, or why there are none."""

    seed: int
    text: str | None
    actions: Sequence[EndEffectorAction] | None
    error: str | None = None

    def to_json(self, *, used: bool) -> JsonObject:
        """As it is stored and answered."""
        num_actions = None if self.actions is None else len(self.actions)
        return {
            "seed": self.seed,
            "reply_text": self.text,
            "num_actions": num_actions,
            "used": used,
            "error": self.error,
        }


class SampledDialogue:
    """Asks every sample of a question at once; in all else like a `Dialogue`.

    Attributes:
        samples: each reply and whether it entered, as stored; None before there are actions or an error.
    """

    def __init__(self, question: Question, model: LanguageModel, timings_ms: Timings) -> None:
        self._dialogues = [(sample, Dialogue(sample, model, {})) for sample in question.samples]
        self._timings_ms = timings_ms
        self.samples: tuple[JsonObject, ...] | None = None

    @property
    def prompt(self) -> Prompt:
        """That of the first sample."""
        return self._dialogues[0][1].prompt

    @property
    def reply_text(self) -> str | None:
        """The first reply that entered, or the first at all."""
        used = [sample["reply_text"] for sample in self.samples or () if sample["used"]]
        return used[0] if used else self._dialogues[0][1].reply_text

    @property
    def usage(self) -> Usage:
        """The samples' together."""
        return reduce(usage_sum, (dialogue.usage for _, dialogue in self._dialogues))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in the replies that entered deserves a look, each kind once."""
        used = [sample["used"] for sample in self.samples or ()]
        found = [f for uses, (_, d) in zip(used, self._dialogues, strict=False) if uses for f in d.findings]
        return tuple({finding.code: finding for finding in reversed(found)}.values())

    @property
    def rows(self) -> list[PlacedRow | None]:
        """The demonstrated row that each action carries out: those of the first reply that entered."""
        used = [sample["used"] for sample in self.samples or ()]
        return next((d.rows for uses, (_, d) in zip(used, self._dialogues, strict=False) if uses), [])

    async def actions(self, *, piecewise: bool) -> AsyncGenerator[Sequence[EndEffectorAction], None]:
        """The actions that most samples agree on, all together: `piecewise` cannot be.

        Raises:
            ReplyParseError: if no more than half of the samples are valid and equally long.
            LanguageModelError: if the LLM does not answer one of them.
        """
        with timed(self._timings_ms, "llm"):
            replies = await self._ask_all()
        with timed(self._timings_ms, "parse"):
            self.samples = tuple(reply.to_json(used=False) for reply in replies)
            agreed = consensus([reply.actions for reply in replies])
        self.samples = tuple(reply.to_json(used=k in agreed.used) for k, reply in enumerate(replies))
        yield agreed.actions

    async def _ask_all(self) -> list[_Reply]:
        """Every reply; the first failure of the LLM ends the others."""
        replies: dict[int, _Reply] = {}

        async def ask(k: int, question: Question, dialogue: Dialogue) -> None:
            replies[k] = await _ask(question, dialogue)

        try:
            async with anyio.create_task_group() as group:
                for k, item in enumerate(self._dialogues):
                    group.start_soon(ask, k, *item)
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None
        return [replies[k] for k in range(len(replies))]


async def _ask(question: Question, dialogue: Dialogue) -> _Reply:
    seed, actions = question.request.options.seed, list[EndEffectorAction]()
    try:
        async with aclosing(dialogue.actions(piecewise=False)) as arriving:
            async for new in arriving:
                if not isinstance(new, TextDelta):  # none comes unless piecewise
                    actions += new
    except ReplyParseError as error:
        return _Reply(seed, dialogue.reply_text, None, error.message)
    except UnsupportedActionError as error:
        return _Reply(seed, dialogue.reply_text, None, str(error))
    return _Reply(seed, dialogue.reply_text, actions)
