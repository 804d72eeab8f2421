"""Several replies to one question, asked for at once: the one that most others are like is the reply."""

from collections.abc import AsyncGenerator

import anyio

from app.llm.base import LanguageModel
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.findings.actions import disagreeing_findings
from app.pipeline.reply import consensus
from app.services.measures import timed, timings_of_its_own
from app.services.predict.question import Question
from app.services.predict.reply import Actions, Reply
from app.store.values import JsonObject


class SampledReply(Reply):
    """Of several replies the one that counts, or the first where none does; nothing comes before all are complete."""

    def __init__(self, question: Question, model: LanguageModel) -> None:
        super().__init__(question, model)
        self._replies = [Reply(question, model, number) for number in range(question.request.options.num_samples)]
        self._chosen: Reply | None = None
        self._disagreeing: tuple[Finding, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings about the reply that counts, and about replies that disagree with it."""
        return (*(() if self._chosen is None else self._chosen.findings), *self._disagreeing)

    async def stream(self) -> AsyncGenerator[Actions, None]:
        async for actions in self.whole():
            yield actions

    async def whole(self) -> AsyncGenerator[Actions, None]:
        """The actions of the reply that counts; the first failure of the LLM ends the other replies.

        Raises:
            ReplyParseError: also if the replies do not agree.
            LanguageModelError: if the LLM does not answer.
        """
        refused = await self._ask_all()
        said = [
            None if k in refused else [item.action for item in reply.actions] for k, reply in enumerate(self._replies)
        ]
        self.samples = self._documents(refused, used=())
        with timed("parse"):
            agreed = consensus(said)
        self.samples = self._documents(refused, used=agreed.alike)
        chosen = self._chosen = self._replies[agreed.chosen]
        self._disagreeing = disagreeing_findings(len(self._replies), len(agreed.alike))
        self.prompt, self.text, self.actions = chosen.prompt, chosen.text, chosen.actions
        yield chosen.actions

    async def _ask_all(self) -> dict[int, str]:
        """Wait for all replies; of those that are not passed on why, by their number."""
        refused: dict[int, str] = {}

        async def ask(number: int, reply: Reply) -> None:
            with timings_of_its_own():
                try:
                    async for _ in reply.whole():
                        pass
                except ReplyParseError as error:
                    refused[number] = error.message
                except UnsupportedActionError as error:
                    refused[number] = str(error)

        try:
            with timed("llm"):
                async with anyio.create_task_group() as group:
                    for item in enumerate(self._replies):
                        group.start_soon(ask, *item)
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None
        finally:
            self.prompt, self.text = self._replies[0].prompt, self._replies[0].text
            for reply in self._replies:
                self.usage = self.usage.plus(reply.usage)
        return refused

    def _documents(self, refused: dict[int, str], used: tuple[int, ...]) -> tuple[JsonObject, ...]:
        return tuple(
            {
                "seed": reply.seed,
                "reply_text": reply.text,
                "num_actions": None if number in refused else len(reply.actions),
                "used": number in used,
                "error": refused.get(number),
            }
            for number, reply in enumerate(self._replies)
        )
