"""An LLM's reply to a question, part by part of the instruction: pieces of text -> rows -> supported actions."""

import time
from collections.abc import AsyncGenerator, Iterator
from contextlib import aclosing
from dataclasses import replace

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModel,
    ModelTimeoutError,
    Reading,
    TextDelta,
    Usage,
)
from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.finding import Finding
from app.pipeline.prompt import Prompt
from app.pipeline.reply import ReplyReader
from app.pipeline.skill.support import PlacedPlan
from app.services.measures import timed
from app.services.predict import doubts
from app.services.predict.part_reply import ActionDoubt, PartReply, PredictedAction
from app.services.predict.question import Question

MAX_TOKENS_PER_ACTION = 80  # more than any representation needs for a row, a token for each digit
Actions = list[PredictedAction]


class Reply:
    """A model's reply as far as it has arrived; read by `arriving`.

    Attributes:
        prompt: the last one asked; for a later part it contains the replies to the parts before.
        text: all replies so far, also an incomplete one; None before the first.
        usage: tokens of all replies.
        actions: those so far, all supported by the demonstrations.
    """

    def __init__(self, question: Question, model: LanguageModel) -> None:
        self.question = question
        self.prompt: Prompt = question.prompt
        self.text: str | None = None
        self.usage = Usage()
        self.actions: Actions = []
        self._options = question.request.options
        self._last_text = ""
        self._doubts: list[ActionDoubt] = []
        self._model = model
        self._deadline_s = time.monotonic() + question.deadline_s

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Those of the actions so far."""
        known, actions = self.question.known, [item.action for item in self.actions]
        seen = [replace(part, objects=(*part.objects, *known.bystanders)) for part in self.question.as_observed]
        return (*doubts.of_actions(self._doubts), *known.skills.of_way(seen, actions))

    async def arriving(self, *, piecewise: bool) -> AsyncGenerator[Actions | TextDelta | Reading, None]:
        """Yield actions once their rows are complete; if requested, also the progress of reading and the text.

        Args:
            piecewise: otherwise the actions of each part come together, at the end of the reply to it.

        Raises:
            ReplyParseError: if a reply is not a list of valid actions.
            UnsupportedActionError: if the demonstrations do not support an action.
            LanguageModelError: if the LLM does not answer; what was yielded may not be all of the reply.
        """
        shows_text = piecewise and self._options.stream_text
        for asked, plans in self._parts():
            part, before, text = self._part(asked, plans), self.text, ""
            async with aclosing(self._model.stream(self._request())) as pieces:
                while not part.complete:
                    with timed("llm"):
                        piece = await anext(pieces)
                    if isinstance(piece, Reading):
                        if shows_text:
                            yield piece
                        continue
                    if not piecewise and isinstance(piece, TextDelta):
                        continue
                    said = len(self.text or "")
                    text = piece.text if isinstance(piece, Completion) else text + piece.text
                    self.text = text if before is None else f"{before}\n{text}"
                    if isinstance(piece, Completion):
                        self._last_text = piece.text
                        self.usage = self.usage.plus(piece.usage)
                    elif shows_text:
                        yield TextDelta(self.text[said:])
                    if actions := part.read(piece):
                        self.actions += actions
                        yield actions
            self._doubts += part.doubts

    def _parts(self) -> Iterator[tuple[Query, tuple[PlacedPlan, ...] | None]]:
        """Yield the parts of the instruction and their plans, setting `prompt` for each."""
        question, most = self.question, self.question.max_actions
        for number, (part, plans) in enumerate(zip(question.parts, question.plans, strict=True)):
            if (remaining := most - len(self.actions)) <= 0:
                message = f"{most} actions do not carry out all {len(question.parts)} parts"
                raise ReplyParseError(message, self.text or "")
            if number > 0:
                codec = question.prefix.template.codec
                written = codec.reply_text(codec.rows(self._last_text, complete=True))
                so_far = f"{self.prompt.query}{written}{codec.separator}"
                self.prompt = question.prefix.template.ask(part, remaining, so_far)
            yield part, plans

    def _part(self, asked: Query, plans: tuple[PlacedPlan, ...] | None) -> PartReply:
        question, num_before = self.question, len(self.actions)
        return PartReply(
            ReplyReader(question.prefix.template.codec, asked, question.max_actions - num_before),
            plans,
            question.known.task.workspace,
            num_before,
            turned=question.turned,
            allows=self._options.unsupported == "allow",
        )

    def _request(self) -> CompletionRequest:
        """Return the request to the LLM; raises ModelTimeoutError if no time is left."""
        question = self.question
        timeout_s = self._deadline_s - time.monotonic()
        if timeout_s <= 0:
            within_s = round(question.deadline_s, 1)
            raise ModelTimeoutError(f"{question.known.profile.name} did not answer within {within_s:g} s")
        return CompletionRequest(
            self.prompt,
            max_tokens=(question.max_actions - len(self.actions)) * MAX_TOKENS_PER_ACTION,
            timeout_s=timeout_s,
            temperature=self._options.temperature,
            seed=self._options.seed,
            cache_key=question.prefix.cache_key,
        )
