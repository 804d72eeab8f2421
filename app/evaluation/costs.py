"""What asking an LLM costs: prices, what a plan is going to use, and a budget that trials are paid from.

Tokens are estimated from dry runs of the prompts. A reply is taken to be as long as one of the prompt's demonstrations
with its observation, for each clause of the instruction: a little more than it is. Tokens that a model thinks are not
foreseen.
"""

import math
import re
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from app.evaluation.failures import BudgetSpentError
from app.evaluation.methods import Method
from app.evaluation.results import Trial
from app.evaluation.teach import Lesson
from app.evaluation.trials import PlannedTrial
from app.pipeline.order.order import clause_texts
from app.sim.outcomes import SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.robot import Observation

LessonOf = Callable[[PlannedTrial], Lesson | Exception]
MILLION = 1_000_000
# Tokenizers of chat models cut text about so: words with the space before them, long ones in pieces; numbers in groups
# of three digits; runs of punctuation; remaining spaces. Some write each digit as a token: they count up to twice as
# many.
_PIECE = re.compile(r" ?[^\W\d_]{1,6}|\d{1,3}| ?[^\w\s]+|_|\s+")


def tokens_of(text: str) -> int:
    """About how many tokens the text has, for a model whose tokenizer is not at hand."""
    return sum(1 for _ in _PIECE.finditer(text))


@dataclass(frozen=True)
class Price:
    """In any currency, for a million tokens.

    Raises:
        InvalidInputError: if one is negative or not finite.
    """

    read: float
    written: float

    def __post_init__(self) -> None:
        for name, price in (("price-in", self.read), ("price-out", self.written)):
            if not (math.isfinite(price) and price >= 0):
                raise InvalidInputError(name, f"is {price:g}", "a finite number, 0 or above")

    def of(self, read: float, written: float) -> float:
        """What the tokens cost. Cached tokens are counted at the full price, which is above what providers charge."""
        return (read * self.read + written * self.written) / MILLION


Prices = Mapping[str, Price]  # by model


def prices_of(models: Sequence[str], read: Sequence[float], written: Sequence[float]) -> Prices:
    """The models' prices; empty if none are given.

    Args:
        read, written: one for all models, or one for each.

    Raises:
        InvalidInputError: if they are of other number, or only one of both is given.
    """
    for name, given in (("price-in", read), ("price-out", written)):
        if len(given) not in (0, 1, len(models)) or bool(read) != bool(written):
            message = f"is given {len(given)} times"
            raise InvalidInputError(name, message, f"once, or once for each of {len(models)} models; both or none")
    if not read:
        return {}
    every = [list(given) * (len(models) if len(given) == 1 else 1) for given in (read, written)]
    return {model: Price(*pair) for model, *pair in zip(models, *every, strict=True)}


@dataclass(frozen=True)
class Usage:
    """Requests and tokens of some trials, and what they cost; None without prices."""

    requests: float = 0
    read: float = 0
    written: float = 0
    cost: float | None = None

    def __add__(self, other: "Usage") -> "Usage":
        costs = [cost for cost in (self.cost, other.cost) if cost is not None]
        return Usage(
            self.requests + other.requests,
            self.read + other.read,
            self.written + other.written,
            sum(costs) if costs else None,
        )


def used_by(trial: Trial, prices: Prices) -> Usage:
    """What the service counted for a trial that it answered; the number of requests is not kept."""
    answer: Mapping[str, Any] = trial.answer or {}
    usage = answer.get("usage") or {}
    read, written = usage.get("prompt_tokens", 0), usage.get("completion_tokens", 0)
    price = prices.get(answer.get("model", ""))
    return Usage(0, read, written, None if price is None else price.of(read, written))


Kind = tuple[str, str]  # task and label of the method: what trials of like cost have in common
Kinds = Mapping[Kind, Usage]  # what a trial of each kind is expected to use


def kind_of(planned: PlannedTrial) -> Kind:
    """The kind of a trial."""
    return planned.task, planned.method.label


@dataclass
class Purse:
    """A budget. Each trial puts its expected cost aside before it asks, and pays what it did cost. Thread-safe.

    Attributes:
        budget: of this session, in the currency of the prices; None: unlimited.
        confirm: called with what trials are expected to use, before an LLM is asked; raises to refuse.
        spent: so far. A trial without usage, by an error or because the provider reports none, counts as expected.
    """

    budget: float | None
    prices: Prices
    confirm: Callable[[Kinds], None]
    spent: float = 0.0
    _kinds: Kinds = field(default_factory=dict)
    _aside: dict[tuple[str, int, str], float] = field(default_factory=dict)
    _factor: float = 1.0
    _closed: bool = False
    _changed: threading.Condition = field(default_factory=threading.Condition)

    def expect(self, kinds: Kinds) -> None:
        """Note what a trial of each kind is going to use, and have it confirmed."""
        self._kinds = kinds
        self.confirm(kinds)

    def put_aside(self, planned: PlannedTrial) -> None:
        """Wait until it is certain whether the trial fits; what others put aside may come back.

        Raises:
            BudgetSpentError: if it does not fit; no later trial does then.
        """
        if self.budget is None:
            return
        with self._changed:
            self._changed.wait_for(lambda: self._closed or not self._aside or self._fits(self._may_cost(planned)))
            cost = self._may_cost(planned)
            if self._closed or not self._fits(cost):
                self._closed = True
                self._changed.notify_all()
                raise BudgetSpentError(
                    f"the next trial may cost {cost:.4g}; of the budget of {self.budget:g}, {self.spent:.4g} is spent"
                )
            self._aside[planned.key] = cost

    def pay(self, planned: PlannedTrial, trial: Trial | None) -> None:
        """Count what the trial cost; None if it ended in an error."""
        with self._changed:
            self._aside.pop(planned.key, None)
            expected = self._expected(planned)
            counted = (None if trial is None else used_by(trial, self.prices).cost) or 0.0
            certain = trial is not None and not trial.error and counted > 0
            cost = counted if certain else max(counted, expected)
            self.spent += cost
            if expected:
                self._factor = max(self._factor, cost / expected)
            self._changed.notify_all()

    def _expected(self, planned: PlannedTrial) -> float:
        return self._kinds.get(kind_of(planned), Usage()).cost or 0.0

    def _may_cost(self, planned: PlannedTrial) -> float:
        """As estimated, times the factor by which the worst estimate so far fell short."""
        return self._expected(planned) * self._factor

    def _fits(self, cost: float) -> bool:
        return self.budget is None or self.spent + sum(self._aside.values()) + cost <= self.budget


def estimates(
    client: RoboPromptClient,
    planned: Iterable[PlannedTrial],
    lesson_of: LessonOf,
    look: Callable[[PlannedTrial], SceneView],
    prices: Prices,
) -> dict[Kind, Usage]:
    """What one trial of each kind uses; without those that could not be taught, which ask no LLM.

    Raises:
        ServiceProblemError, ServiceUnreachableError: if the service writes no prompt.
    """
    longest: dict[str, SceneView] = {}
    found: dict[Kind, Usage] = {}
    planned = list(planned)
    for trial in {(trial.task, trial.seed): trial for trial in planned}.values():
        scene = look(trial)
        known = longest.setdefault(trial.task, scene)
        longest[trial.task] = max(known, scene, key=lambda view: len(clause_texts(view.instruction)))
    for trial in {kind_of(trial): trial for trial in planned}.values():
        if isinstance(lesson := lesson_of(trial), Lesson):
            usage = _of_a_trial(client, trial.method, lesson, longest[trial.task])
            price = prices.get(trial.method.options["model"])
            cost = None if price is None else price.of(usage.read, usage.written)
            found[kind_of(trial)] = replace(usage, cost=cost)
    return found


def _of_a_trial(client: RoboPromptClient, method: Method, lesson: Lesson, scene: SceneView) -> Usage:
    stepwise = method.source == "closed loop"
    options = {**method.options, **({"closed_loop": True} if stepwise else {})}
    answer = client.dry_run(lesson.name, scene.instruction, Observation(scene.objects), **options)
    prompt = answer["prompt"]
    read = tokens_of(prompt["system"]) + tokens_of(prompt["user"])
    parts = len(clause_texts(scene.instruction))
    demonstration = tokens_of(prompt["user"]) / max(1, len(answer["demonstration_ids"]))
    # a step for each keyframe of a demonstration, and one that says that there are no more
    requests = parts * max(len(item.document["keyframes"]) for item in lesson.taught) + 1 if stepwise else 1
    return Usage(requests, requests * read, parts * demonstration)
