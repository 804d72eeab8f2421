"""Lists of predictions for pages, without prompts; and the success of each configuration."""

from dataclasses import dataclass, fields

from sqlalchemy import Connection, case, func, select

from app.pipeline.success_rate import SuccessRate
from app.store import tables
from app.store.filters import PredictionFilter, fetch_page, num_demonstrations
from app.store.records import Page, PredictionSummary

_P = tables.predictions


_SUMMARY = [
    _P.c[field.name] if field.name in _P.c else num_demonstrations.label(field.name)
    for field in fields(PredictionSummary)
]


def list_page(
    connection: Connection, chosen: PredictionFilter, limit: int, cursor: int | None = None
) -> Page[PredictionSummary]:
    """At most `limit` predictions that fit, newest first."""
    query = chosen.narrow(select(*_SUMMARY))
    return fetch_page(connection, _P, query, limit, cursor, lambda row: PredictionSummary(**row._mapping))


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
