"""Lists of predictions for pages: without prompts, ordered by outcome; and the success of each configuration."""

from dataclasses import dataclass, fields
from typing import Literal

from sqlalchemy import Connection, case, func, or_, select

from app.pipeline.success_rate import SuccessRate
from app.store import tables
from app.store.filters import FATES, OF_FATE, PredictionFilter, num_demonstrations
from app.store.records import PredictionSummary

ListOrder = Literal["successes", "newest", "failures"]

_P = tables.predictions


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
    """Return the names of all models of predictions, sorted."""
    return tuple(connection.scalars(select(_P.c.model).distinct().order_by(_P.c.model)))


@dataclass(frozen=True)
class Configuration:
    """A way to ask for predictions."""

    model: str
    representation: str
    prompt_format: str
    selection: str | None  # None where the request named its episodes
    num_demonstrations: int


@dataclass(frozen=True)
class Counts:
    """How predictions ended; `errors` are those without actions, the outcomes those that were recorded."""

    predictions: int
    errors: int
    successes: int
    failures: int

    @property
    def rate(self) -> SuccessRate:
        """Of the predictions whose outcome is known."""
        return SuccessRate(self.successes, self.successes + self.failures)


# What a request leaves out is the default, as it was asked; named episodes are no selection.
_NAMED, _SELECTED = (_P.c.request[name].as_string() for name in ("episode_ids", "selection"))
_CONFIGURATION = (
    _P.c.model.label("model"),
    _P.c.representation.label("representation"),
    _P.c.prompt_format.label("prompt_format"),
    case((_NAMED.is_(None), func.coalesce(_SELECTED, "first")), else_=None).label("selection"),
    num_demonstrations.label("num_demonstrations"),
)


def counts_by_configuration(connection: Connection, task: str) -> dict[Configuration, Counts]:
    """Count the outcomes of a task's predictions, the surest success first."""
    outcome = _P.c.outcome_success
    counted = (func.count().filter(item) for item in (_P.c.status != "ok", outcome.is_(True), outcome.is_(False)))
    query = select(*_CONFIGURATION, func.count(), *counted).where(_P.c.task == task).group_by(*_CONFIGURATION)
    rows = connection.execute(query.order_by(func.count().desc(), *_CONFIGURATION[:2]))
    found = ((Configuration(*row[:5]), Counts(*row[5:])) for row in rows)
    return dict(sorted(found, key=lambda item: item[1].rate.interval[0], reverse=True))
