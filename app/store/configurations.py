"""Queries on predictions by the way in which they were asked for: how many ended how, and how the latest went."""

from collections import defaultdict
from dataclasses import astuple, dataclass
from hashlib import sha256

from sqlalchemy import Connection, case, func, select

from app.pipeline.success_rate import SuccessRate
from app.store import tables
from app.store.records import PredictionRecord
from app.store.visibility import of_visible_predictions

MAX_LATEST = 2000  # predictions whose outcomes, times and tokens are read
_P = tables.predictions


@dataclass(frozen=True)
class Configuration:
    """A way to ask for predictions.

    Attributes:
        selection: None where the request named its episodes.
    """

    model: str
    representation: str
    prompt_format: str
    selection: str | None
    num_demonstrations: int
    num_samples: int

    @classmethod
    def of(cls, record: PredictionRecord) -> "Configuration":
        """The one of a recorded prediction."""
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
    """How predictions ended; `errors` are those without actions, the outcomes those that were recorded."""

    predictions: int
    errors: int
    successes: int
    failures: int

    @property
    def rate(self) -> SuccessRate:
        """Of the predictions whose outcome is known."""
        return SuccessRate(self.successes, self.successes + self.failures)


@dataclass(frozen=True)
class Trial:
    """A prediction of which a robot's outcome may be known.

    Attributes:
        llm_ms, tokens: None where they were not measured; tokens: of the prompt, and of the reply.
    """

    success: bool | None
    llm_ms: float | None
    tokens: tuple[int, int] | None


# What a request leaves out is the default, as it was asked; named episodes are no selection.
_NAMED, _SELECTED = (_P.c.request[name].as_string() for name in ("episode_ids", "selection"))
_CONFIGURATION = (
    _P.c.model.label("model"),
    _P.c.representation.label("representation"),
    _P.c.prompt_format.label("prompt_format"),
    case((_NAMED.is_(None), func.coalesce(_SELECTED, "first")), else_=None).label("selection"),
    func.json_array_length(_P.c.demonstration_ids).label("num_demonstrations"),
    func.coalesce(func.json_array_length(_P.c.samples), 1).label("num_samples"),
)


def counts(connection: Connection, task: str | None = None) -> dict[Configuration, Counts]:
    """How the predictions ended that are seen, of one task or of all, the most often tried configuration first."""
    outcome = _P.c.outcome_success
    counted = (func.count().filter(item) for item in (_P.c.status != "ok", outcome.is_(True), outcome.is_(False)))
    query = of_visible_predictions(select(*_CONFIGURATION, func.count(), *counted), task).group_by(*_CONFIGURATION)
    rows = connection.execute(query.order_by(func.count().desc(), *_CONFIGURATION[:2]))
    return {Configuration(*row[:6]): Counts(*row[6:]) for row in rows}


def latest(connection: Connection, task: str | None = None) -> dict[Configuration, tuple[Trial, ...]]:
    """How the latest predictions went, the oldest of them first, by configuration."""
    query = of_visible_predictions(select(*_CONFIGURATION, _P.c.outcome_success, _P.c.timings_ms, _P.c.usage), task)
    rows = connection.execute(query.order_by(_P.c.sequence.desc()).limit(MAX_LATEST)).all()
    found: dict[Configuration, list[Trial]] = defaultdict(list)
    for *key, success, timings_ms, usage in reversed(rows):
        tokens = (usage["prompt_tokens"], usage["completion_tokens"]) if usage else None
        found[Configuration(*key)].append(Trial(success, timings_ms.get("llm"), tokens))
    return {key: tuple(trials) for key, trials in found.items()}
