"""The talk with an LLM that writes a program: asked once, run apart, planned, and handed on as a whole."""

from collections.abc import AsyncGenerator, Iterator, Sequence
from contextlib import aclosing

import anyio.to_thread

from app.llm.base import Completion, CompletionRequest, LanguageModel, TextDelta, Usage
from app.pipeline.errors import ReplyParseError
from app.pipeline.findings import Finding
from app.pipeline.plans.support import PlacedRow
from app.pipeline.prompt import Prompt
from app.services.measures import Timings, timed
from app.services.predict.question import ProgramQuestion
from app.store.values import JsonObject
from app.voxposer.errors import ProgramRefusedError
from app.voxposer.plan import Planned, plan_moves
from app.voxposer.prompt import program_of
from app.voxposer.sandbox import run_program
from roboprompt_client.trajectory import EndEffectorAction

MAX_TOKENS = 1024  # of a program; the longest of `evaluation/oracle_programs` has about 900


class ProgramDialogue:
    """Asks, runs and plans; attributes as `Dialogue`. No action comes before all of the program has run."""

    def __init__(self, question: ProgramQuestion, model: LanguageModel, timings_ms: Timings) -> None:
        self._question = question
        self._model = model
        self._timings_ms = timings_ms
        self._planned = Planned(())
        self.rows: list[PlacedRow | None] = []
        self.prompt: Prompt = question.prompt
        self.reply_text: str | None = None
        self.usage = Usage()
        self.samples: tuple[JsonObject, ...] | None = None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What in the plan deserves a look."""
        return tuple(_findings(self._planned))

    async def actions(self, *, piecewise: bool) -> AsyncGenerator[Sequence[EndEffectorAction] | TextDelta, None]:
        """Every action of the program, at once; with `piecewise` before them its text, if the request asks for it.

        Raises:
            LanguageModelError: if the LLM does not answer.
            ReplyParseError: if its program is cut off, refused, or fails.
        """
        async with aclosing(self._model.stream(self._asked(piecewise=piecewise))) as pieces:
            while True:
                with timed(self._timings_ms, "llm"):
                    piece = await anext(pieces)
                if isinstance(piece, Completion):
                    completion = piece
                    break
                self.reply_text = (self.reply_text or "") + piece.text
                if self._question.request.options.stream_text:
                    yield piece
        self.reply_text, self.usage = completion.text, completion.usage
        with timed(self._timings_ms, "program"):
            self._planned = await anyio.to_thread.run_sync(self._plan, completion)
        yield self._planned.actions

    def _plan(self, completion: Completion) -> Planned:
        if completion.finish_reason == "length":
            tokens = completion.usage.completion_tokens
            raise ReplyParseError(f"the program was cut off after {tokens} tokens", completion.text)
        scene, max_actions = self._question.scene, self._question.request.options.max_actions
        try:
            return plan_moves(run_program(program_of(completion.text), scene), scene, max_actions)
        except ProgramRefusedError as error:
            raise ReplyParseError(str(error), completion.text) from error

    def _asked(self, *, piecewise: bool) -> CompletionRequest:
        options = self._question.request.options
        return CompletionRequest(
            self.prompt,
            max_tokens=MAX_TOKENS,
            timeout_s=options.timeout_s,
            temperature=options.sampling_temperature,
            seed=options.seed,
            cache_key=self._question.template.cache_key,
            piecewise=piecewise,
        )


def _findings(planned: Planned) -> Iterator[Finding]:
    if planned.stuck:
        message = (
            f"In move {_listed(planned.stuck)} of the program the descent over the value maps ended short of its "
            "target: the rest of the way is straight, whatever the program wants to keep away from."
        )
        yield Finding("planner-stuck", "warning", message, "actions")
    if planned.slowed:
        message = f"The program slows move {_listed(planned.slowed)}; actions have no speed, so the robot decides it."
        yield Finding("velocity-not-sent", "info", message, "actions")


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))
