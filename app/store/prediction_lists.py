"""Lists of predictions for pages: without prompts, ordered by outcome; and the success of each configuration."""

from collections import defaultdict
from dataclasses import astuple, dataclass, fields
from hashlib import sha256
from typing import Literal

from sqlalchemy import Connection, case, func, or_, select

from app.pipeline.success_rate import SuccessRate
from app.store import tables
from app.store.filters import FATES, OF_FATE, PredictionFilter, num_demonstrations
from app.store.records import PredictionRecord, PredictionSummary
from app.store.visibility import of_visible_predictions

ListOrder = Literal["successes", "newest", "failures"]

_P = tables.predictions
MAX_LATEST = 2000  # predictions whose outcomes, times and tokens are read


_SUMMARY = [
    _P.c[field.name] if field.name in _P.c else num_demonstrations.label(field.name)
    for field in fields(PredictionSummary)
]


@dataclass(frozen=True)
class ListCursor:
    """The place where a list continues: the last row's group and number."""

    group: int
    sequence: int


@dataclass(frozen=True)
class SummaryPage:
    """Some predictions, and where those that follow begin; None at the end."""

    items: tuple[PredictionSummary, ...]
    next_cursor: ListCursor | None


def list_page(
    connection: Connection, chosen: PredictionFilter, order: ListOrder, limit: int, cursor: ListCursor | None = None
) -> SummaryPage:
    """At most `limit` predictions: the newest first, or by their fate and then the newest."""
    fates = FATES if order == "failures" else FATES[::-1]
    groups = [or_(*OF_FATE.values())] if order == "newest" else [OF_FATE[fate] for fate in fates]
    found: list[tuple[int, PredictionSummary]] = []
    for number, fits in enumerate(groups):
        if cursor is not None and number < cursor.group:
            continue
        query = chosen.narrow(select(*_SUMMARY).where(fits))
        if cursor is not None and number == cursor.group:
            query = query.where(_P.c.sequence < cursor.sequence)
        room = limit + 1 - len(found)
        rows = connection.execute(query.order_by(_P.c.sequence.desc()).limit(room))
        found += [(number, PredictionSummary(**row._mapping)) for row in rows]
        if len(found) > limit:
            group, last = found[limit - 1]
            return SummaryPage(tuple(item for _, item in found[:limit]), ListCursor(group, last.sequence))
    return SummaryPage(tuple(item for _, item in found), None)


def models(connection: Connection) -> tuple[str, ...]:
    """Return the names of all models of visible predictions, sorted."""
    return tuple(connection.scalars(of_visible_predictions(select(_P.c.model)).distinct().order_by(_P.c.model)))


@dataclass(frozen=True)
class Configuration:
    """A way to ask for predictions."""

    model: str
    representation: str
    prompt_format: str
    selection: str | None  # None where the request named its episodes
    num_demonstrations: int
    num_samples: int

    @classmethod
    def of(cls, record: PredictionRecord) -> "Configuration":
        asked = record.request
        selection = asked.get("selection", "first") if asked.get("episode_ids") is None else None
        number, samples = len(record.demonstration_ids), len(record.samples or (None,))
        return cls(record.model, record.representation, record.prompt_format, selection, number, samples)

    @property
    def id(self) -> str:
        """For addresses: the same for equal configurations."""
        return sha256(repr(astuple(self)).encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Counts:
    """How predictions ended, and what they cost.

    `errors` are those without actions, the outcomes those that were recorded; `cost_usd` is the sum of the `priced`
    ones, whose cost is known, None if there is none.
    """

    predictions: int
    errors: int
    successes: int
    failures: int
    cost_usd: float | None = None
    priced: int = 0

    @property
    def mean_cost_usd(self) -> float | None:
        return None if self.cost_usd is None else self.cost_usd / self.priced

    @property
    def rate(self) -> SuccessRate:
        """Of the predictions whose outcome is known."""
        return SuccessRate(self.successes, self.successes + self.failures)


@dataclass(frozen=True)
class Attempt:
    """A prediction of which a robot's outcome may be known.

    Attributes:
        llm_ms, tokens: None where they were not measured; tokens: of the prompt, and of the reply.
    """

    success: bool | None
    llm_ms: float | None
    tokens: tuple[int, int] | None


# What a request leaves out is the default, as it was asked; named episodes are no selection.
_NAMED, _SELECTED = (_P.c.request[name].as_string() for name in ("episode_ids", "selection"))
_COST_USD = _P.c.usage["cost_usd"].as_float()
_CONFIGURATION = (
    _P.c.model.label("model"),
    _P.c.representation.label("representation"),
    _P.c.prompt_format.label("prompt_format"),
    case((_NAMED.is_(None), func.coalesce(_SELECTED, "first")), else_=None).label("selection"),
    num_demonstrations.label("num_demonstrations"),
    func.coalesce(func.json_array_length(_P.c.samples), 1).label("num_samples"),
)


def counts_by_configuration(connection: Connection, task: str | None = None) -> dict[Configuration, Counts]:
    """Count the outcomes of the visible predictions, of one task or of all, most tried configuration first."""
    outcome = _P.c.outcome_success
    counted = (func.count().filter(item) for item in (_P.c.status != "ok", outcome.is_(True), outcome.is_(False)))
    costs = (func.sum(_COST_USD), func.count(_COST_USD))
    columns = select(*_CONFIGURATION, func.count(), *counted, *costs)
    query = of_visible_predictions(columns, task).group_by(*_CONFIGURATION)
    rows = connection.execute(query.order_by(func.count().desc(), *_CONFIGURATION[:2]))
    return {Configuration(*row[:6]): Counts(*row[6:]) for row in rows}


def latest_by_configuration(
    connection: Connection, task: str | None = None
) -> dict[Configuration, tuple[Attempt, ...]]:
    """Return the latest predictions as trials by configuration, oldest first."""
    query = of_visible_predictions(select(*_CONFIGURATION, _P.c.outcome_success, _P.c.timings_ms, _P.c.usage), task)
    rows = connection.execute(query.order_by(_P.c.sequence.desc()).limit(MAX_LATEST)).all()
    found: dict[Configuration, list[Attempt]] = defaultdict(list)
    for *key, success, timings_ms, usage in reversed(rows):
        tokens = (usage["prompt_tokens"], usage["completion_tokens"]) if usage else None
        found[Configuration(*key)].append(Attempt(success, timings_ms.get("llm"), tokens))
    return {key: tuple(trials) for key, trials in found.items()}
