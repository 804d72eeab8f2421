"""One prediction's talk with an LLM: the parts of an instruction are asked for in turn."""

import time
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import replace

from app.llm.base import Completion, CompletionRequest, LanguageModel, ModelTimeoutError, TextDelta, Usage
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.findings.actions import ActionDoubt, action_findings, passing_findings
from app.pipeline.plans.support import PlacedRow
from app.pipeline.prompt import Prompt
from app.pipeline.reply import ReplyReader
from app.services.measures import Timings, timed
from app.services.predict.doubts import SupportCheck
from app.services.predict.question import Question
from app.store.values import JsonObject
from roboprompt_client.trajectory import EndEffectorAction

AGAIN_TEMPERATURE = 0.3  # of the second try: a greedy one would say the same again
MAX_TOKENS_PER_ACTION = 80  # more than any representation needs for a row, a token for each digit


class Dialogue:
    """Asks, reads, and keeps what was said.

    Attributes:
        samples: None: there is one reply.
        prompt: the last that was asked.
        reply_text: every reply so far, read piecewise also one that broke off; None while there is none.
        usage: the replies' together.
        rows: the demonstrated row that each action carries out, where it is known.
    """

    def __init__(self, question: Question, model: LanguageModel, timings_ms: Timings) -> None:
        self._question = question
        self._model = model
        self._timings_ms = timings_ms
        self._deadline_s = time.monotonic() + question.request.options.timeout_s
        self._so_far = question.so_far
        self._temperature = question.request.options.sampling_temperature
        self._doubts: list[ActionDoubt] = []
        self._actions: list[EndEffectorAction] = []
        self.rows: list[PlacedRow | None] = []
        self.prompt: Prompt = question.prompt
        self.reply_text: str | None = None
        self.usage = Usage()
        self.samples: tuple[JsonObject, ...] | None = None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in the replies deserves a look."""
        question = self._question
        passing = passing_findings(question.seen, self._actions, question.template.ways)
        return (*action_findings(self._doubts), *passing)

    async def actions(self, *, piecewise: bool) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta, None]:
        """The actions of every reply, as many at a time as became complete together.

        With `piecewise` also its text, if the request asks for it.

        Args:
            piecewise: hand out each as soon as its row is complete; otherwise when its reply is.

        Raises:
            ReplyParseError: if a reply is not a list of valid actions; what was handed out may not be all of it.
            UnsupportedActionError: if the demonstrations do not support an action.
            LanguageModelError: if the LLM does not answer.
        """
        question = self._question
        remaining = question.request.options.max_actions
        for number, instruction in enumerate(question.instructions):
            if remaining <= 0:
                asked, most = len(question.instructions), question.request.options.max_actions
                raise ReplyParseError(f"{most} actions do not carry out all {asked} parts", self.reply_text or "")
            if number > 0:
                self.prompt = question.written.ask(question.query(instruction), remaining, self._so_far)
            async with aclosing(self._part(instruction, remaining, piecewise=piecewise)) as arriving:
                async for item in arriving:
                    if not isinstance(item, TextDelta):
                        remaining -= len(item)
                        self._actions += item
                    yield item

    async def _part(
        self, instruction: str, max_actions: int, *, piecewise: bool
    ) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta, None]:
        """The actions of one instruction; a whole reply that the demonstrations do not support is asked for again."""
        try:
            async with aclosing(self._supported(instruction, max_actions, piecewise=piecewise)) as arriving:
                async for item in arriving:
                    yield item
            return
        except UnsupportedActionError:
            if piecewise:
                raise
            self._temperature = max(self._temperature, AGAIN_TEMPERATURE)
        async with aclosing(self._supported(instruction, max_actions, piecewise=piecewise)) as arriving:
            async for item in arriving:
                yield item

    async def _supported(
        self, instruction: str, max_actions: int, *, piecewise: bool
    ) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta, None]:
        """The actions of the reply to one instruction, as far as the demonstrations support them."""
        question = self._question
        reader = ReplyReader(question.codec, question.query(instruction), max_actions)
        support = SupportCheck(question, instruction, question.request.options.max_actions - max_actions)
        async with aclosing(self._reply(reader, max_actions, piecewise=piecewise)) as arriving:
            async for item in arriving:
                if not isinstance(item, TextDelta):
                    rows = support.check(item)
                    if not piecewise:  # it is all of the reply
                        support.finish()
                    self.rows += rows
                yield item
        if piecewise:
            support.finish()
        self._doubts += support.doubts

    async def _reply(
        self, reader: ReplyReader, max_actions: int, *, piecewise: bool
    ) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta, None]:
        """The actions of the reply to the prompt."""
        num_early = 0
        async with aclosing(self._arriving(reader, max_actions, piecewise=piecewise)) as arriving:
            async for item in arriving:
                if isinstance(item, Completion):
                    completion = item
                    break
                if not isinstance(item, TextDelta):
                    num_early += len(item)
                yield item
        self.usage = usage_sum(self.usage, completion.usage)
        with timed(self._timings_ms, "parse"):
            actions = self._finished(reader, completion)
        if len(actions) > num_early:
            yield actions[num_early:]

    async def _arriving(
        self, reader: ReplyReader, max_actions: int, *, piecewise: bool
    ) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta | Completion, None]:
        """The actions as their rows become complete, and the text, if it is asked for; last the completion."""
        async with aclosing(self._pieces(max_actions, piecewise=piecewise)) as pieces:
            while True:
                said = len(self.reply_text or "")
                with timed(self._timings_ms, "llm"):
                    piece = await anext(pieces)
                if isinstance(piece, Completion):
                    yield piece
                    return
                if self._question.request.options.stream_text:
                    yield TextDelta((self.reply_text or "")[said:])
                with timed(self._timings_ms, "parse"):
                    new = reader.feed(piece.text)
                if new:
                    yield new

    def _finished(self, reader: ReplyReader, completion: Completion) -> tuple[EndEffectorAction, ...]:
        if completion.finish_reason == "length":
            tokens = completion.usage.completion_tokens
            raise ReplyParseError(f"the reply was cut off after {tokens} tokens", completion.text)
        actions = reader.finish(completion.text)
        codec = self._question.codec
        written = codec.reply_text(codec.rows(completion.text, complete=True))
        self._so_far = f"{self.prompt.query}{written}{codec.separator}"
        return actions

    async def _pieces(self, max_actions: int, *, piecewise: bool) -> AsyncGenerator[TextDelta | Completion, None]:
        """The reply as the LLM writes it; `reply_text` grows with it."""
        before, text = self.reply_text, ""
        async with aclosing(self._model.stream(self._asked(max_actions, piecewise=piecewise))) as stream:
            async for piece in stream:
                text = piece.text if isinstance(piece, Completion) else text + piece.text
                self.reply_text = _joined(before, text)
                yield piece

    def _asked(self, max_actions: int, *, piecewise: bool) -> CompletionRequest:
        """The prompt as it is put to the LLM.

        Raises:
            ModelTimeoutError: if no time is left.
        """
        name, options = self._question.profile.name, self._question.request.options
        timeout_s = self._deadline_s - time.monotonic()
        if timeout_s <= 0:
            raise ModelTimeoutError(f"{name} did not answer within {options.timeout_s:g} s")
        return CompletionRequest(
            self.prompt,
            max_tokens=max_actions * MAX_TOKENS_PER_ACTION,
            timeout_s=timeout_s,
            temperature=self._temperature,
            seed=options.seed,
            cache_key=self._question.template.cache_key,
            piecewise=piecewise,
        )


def _joined(before: str | None, text: str) -> str:
    return text if before is None else f"{before}\n{text}"


def usage_sum(one: Usage, other: Usage) -> Usage:
    """The tokens of two completions together."""
    return replace(
        one,
        prompt_tokens=one.prompt_tokens + other.prompt_tokens,
        cached_tokens=one.cached_tokens + other.cached_tokens,
        completion_tokens=one.completion_tokens + other.completion_tokens,
    )
