"""An LLM's reply to a question: pieces of text -> rows -> actions that demonstrations support, within bounds of motion.

The parts of an instruction are asked for in turn. Of several samples the one that most others are like is the reply.
"""

import time
from collections.abc import AsyncGenerator, Iterator, Sequence
from contextlib import aclosing

import anyio

from app.llm.base import (
    Completion,
    CompletionRequest,
    LanguageModel,
    ModelTimeoutError,
    Reading,
    TextDelta,
    Usage,
    complete,
)
from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.findings.actions import ActionDoubt, action_findings, disagreeing_findings, passing_findings
from app.pipeline.prompt import Prompt
from app.pipeline.reply import consensus
from app.services.measures import timed, timings, timings_of_its_own
from app.services.predict.motion_check import MotionCheck
from app.services.predict.part_reply import PartReply, PredictedAction
from app.services.predict.question import Question
from app.store.values import JsonObject

AGAIN_TEMPERATURE = 0.3  # of the second try: a greedy one would say the same again
MAX_TOKENS_PER_ACTION = 80  # more than any representation needs for a row, a token for each digit
Arriving = PredictedAction | TextDelta | Reading


class Reply:
    """What a model replies; filled by `whole` or `stream`, and kept as far as it came where these raise.

    Attributes:
        prompt: the last that was asked: with several instructions it holds the replies to those before.
        text: every reply so far, while it streams also one that broke off; None while there is none. Of several
            samples the one that counts, or the first where none does.
        usage: the replies' together.
        actions: those that demonstrations support, so far.
        samples: each reply and whether it does as the one that counts, as stored; None where one reply is asked for.

    Args:
        motion: holds the actions against bounds of motion; None: nothing does.
    """

    def __init__(self, question: Question, model: LanguageModel, motion: MotionCheck | None = None) -> None:
        self.question = question
        self.prompt: Prompt = question.prompt
        self.text: str | None = None
        self.usage = Usage()
        self.actions: list[PredictedAction] = []
        self.samples: tuple[JsonObject, ...] | None = None
        self._chosen: Reply | None = None
        self._disagreeing: tuple[Finding, ...] = ()
        self._last_text = ""
        self._doubts: list[ActionDoubt] = []
        self._model = model
        self._motion = motion
        self._temperature = question.request.options.sampling_temperature
        self._deadline_s = time.monotonic() + question.deadline_s

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in it deserves a look; of several samples those of the one that counts."""
        if self.question.samples:
            found = () if self._chosen is None else self._chosen.findings
            return (*found, *self._disagreeing)
        actions, question = [item.action for item in self.actions], self.question
        passing = passing_findings(question.seen, actions, question.known.taught.ways, question.known.scene.bystanders)
        odd = question.known.taught.of_answer(question.parts, actions, question.prefix.demonstration_ids)
        return (*action_findings(self._doubts), *passing, *(odd if actions else ()))

    async def whole(self) -> None:
        """Wait for every part; one that the demonstrations do not support is asked for once more.

        Raises:
            ReplyParseError: if a reply is not a list of valid actions, or samples do not agree.
            UnsupportedActionError: if the demonstrations do not support an action.
            UnsafeActionError: if an action is beyond a bound of motion.
            LanguageModelError: if the LLM does not answer.
        """
        if self.question.samples:
            await self._take(await self._agreed())
            return
        for asked in self._parts():
            try:
                actions = await self._supported(asked)
            except UnsupportedActionError:
                self._temperature = max(self._temperature, AGAIN_TEMPERATURE)
                actions = await self._supported(asked)
            await self._take(actions)

    async def stream(self) -> AsyncGenerator[Arriving, None]:
        """Each action as soon as its row is complete; if the request asks for it, progress of reading and the text.

        Not for several samples, of which nothing can come before all are complete.

        Raises:
            as `whole`; what was handed out may not be all of the reply.
        """
        for asked in self._parts():
            part, before, text = PartReply(self.question, asked, len(self.actions)), self.text, ""
            async with aclosing(self._model.stream(self._request(piecewise=True))) as pieces:
                while not part.complete:
                    with timed("llm"):
                        piece = await anext(pieces)
                    if isinstance(piece, Reading):
                        if self.question.request.options.stream_text:
                            yield piece
                        continue
                    said = len(self.text or "")
                    text = piece.text if isinstance(piece, Completion) else text + piece.text
                    self.text = _joined(before, text)
                    if isinstance(piece, Completion):
                        self._heard(piece)
                    elif self.question.request.options.stream_text:
                        yield TextDelta(self.text[said:])
                    new = part.read(piece)
                    await self._take(new, sent_now=True)
                    for number, action in enumerate(new):
                        if number > 0 and self._motion is not None:  # the one before may have been read slowly
                            await self._motion.again()
                        yield action
            part.support.finish()
            self._doubts += part.support.doubts

    def _parts(self) -> Iterator[Query]:
        """The parts of the instruction, one after the other; `prompt` asks for it."""
        question, most = self.question, self.question.request.options.max_actions
        for number, part in enumerate(question.parts):
            if (remaining := most - len(self.actions)) <= 0:
                message = f"{most} actions do not carry out all {len(question.parts)} parts"
                raise ReplyParseError(message, self.text or "")
            if number > 0:
                codec = question.template.codec
                written = codec.reply_text(codec.rows(self._last_text, complete=True))
                so_far = f"{self.prompt.query}{written}{codec.separator}"
                self.prompt = question.template.ask(part, remaining, so_far)
            yield part

    async def _supported(self, asked: Query) -> list[PredictedAction]:
        """The actions of the whole reply to one part."""
        part = PartReply(self.question, asked, len(self.actions))
        with timed("llm"):
            completion = await complete(self._model, self._request(piecewise=False))
        self.text = _joined(self.text, completion.text)
        self._heard(completion)
        actions = part.read(completion)
        part.support.finish()
        self._doubts += part.support.doubts
        return actions

    async def _agreed(self) -> list[PredictedAction]:
        """The actions of the sample that most others are like; the first failure of the LLM ends the other samples."""
        replies = [Reply(sample, self._model) for sample in self.question.samples]
        refused: dict[int, str] = {}

        async def ask(number: int, reply: Reply) -> None:
            with timings_of_its_own():
                try:
                    await reply.whole()
                except ReplyParseError as error:
                    refused[number] = error.message
                except UnsupportedActionError as error:
                    refused[number] = str(error)

        try:
            with timed("llm"):
                async with anyio.create_task_group() as group:
                    for item in enumerate(replies):
                        group.start_soon(ask, *item)
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None
        finally:
            self.prompt, self.text = replies[0].prompt, replies[0].text
            for reply in replies:
                self._add_usage(reply.usage)
        said = [None if k in refused else [item.action for item in reply.actions] for k, reply in enumerate(replies)]
        self.samples = tuple(_sample(reply, refused.get(k), used=False) for k, reply in enumerate(replies))
        with timed("parse"):
            agreed = consensus(said)
        chosen = self._chosen = replies[agreed.chosen]
        self._disagreeing = disagreeing_findings(len(replies), len(agreed.alike))
        self.samples = tuple(_sample(r, refused.get(k), used=k in agreed.alike) for k, r in enumerate(replies))
        self.prompt, self.text = chosen.prompt, chosen.text
        return chosen.actions

    async def _take(self, actions: Sequence[PredictedAction], *, sent_now: bool = False) -> None:
        """Let the next actions pass, if they are within the bounds of motion."""
        if actions:
            self.actions += actions
            if self._motion is not None:
                await self._motion.check([item.action for item in actions], sent_now=sent_now)
            timings().reached("first_action")

    def _heard(self, completion: Completion) -> None:
        self._last_text = completion.text
        self._add_usage(completion.usage)

    def _add_usage(self, usage: Usage) -> None:
        self.usage = Usage(
            self.usage.prompt_tokens + usage.prompt_tokens,
            self.usage.cached_tokens + usage.cached_tokens,
            self.usage.completion_tokens + usage.completion_tokens,
        )

    def _request(self, *, piecewise: bool) -> CompletionRequest:
        """The prompt as it is put to the LLM.

        Raises:
            ModelTimeoutError: if no time is left.
        """
        question, options = self.question, self.question.request.options
        timeout_s = self._deadline_s - time.monotonic()
        if timeout_s <= 0:
            within_s = round(question.deadline_s, 1)
            raise ModelTimeoutError(f"{question.known.profile.name} did not answer within {within_s:g} s")
        return CompletionRequest(
            self.prompt,
            max_tokens=(options.max_actions - len(self.actions)) * MAX_TOKENS_PER_ACTION,
            timeout_s=timeout_s,
            temperature=self._temperature,
            seed=options.seed,
            cache_key=question.prefix.cache_key,
            piecewise=piecewise,
        )


def _sample(reply: Reply, error: str | None, *, used: bool) -> JsonObject:
    """A reply as it is stored and answered."""
    return {
        "seed": reply.question.request.options.seed,
        "reply_text": reply.text,
        "num_actions": None if error is not None else len(reply.actions),
        "used": used,
        "error": error,
    }


def _joined(before: str | None, text: str) -> str:
    return text if before is None else f"{before}\n{text}"
