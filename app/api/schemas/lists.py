"""What lists are asked for in an address: the API's, and those of the pages, whose forms send the same names."""

import re
from datetime import UTC, date, datetime, time
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field

from app.store.filters import EpisodeFilter, Outcome, PredictionFilter

_DAY = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
MAX_DURATION_S = 1e6


def _utc(moment: datetime) -> datetime:
    """`moment` in UTC, which it is in if it has no zone."""
    try:
        return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except OverflowError:
        raise ValueError("is not within the years 1 to 9999 in UTC") from None


def _end_of_day(value: object) -> object:
    """The last moment of a date without a time."""
    if isinstance(value, str) and _DAY.fullmatch(value):
        return datetime.combine(date.fromisoformat(value), time.max)
    return value


_From = Annotated[datetime, AfterValidator(_utc)]
_To = Annotated[datetime, BeforeValidator(_end_of_day), AfterValidator(_utc)]
_Duration = Annotated[float, Field(ge=0, le=MAX_DURATION_S, allow_inf_nan=False)]


class PageQuery(BaseModel):
    """Which page of a list is asked for."""

    limit: Annotated[int, Field(ge=1, le=200, description="largest number of items in the answer")] = 50
    cursor: Annotated[int | None, Field(ge=1, le=2**63 - 1, description="`next_cursor` of the page before")] = None


class Filtered(BaseModel):
    """What episodes and predictions are filtered by."""

    task: Annotated[str | None, Field(max_length=64, description="only of this task")] = None
    created_from: Annotated[
        _From | None, Field(description="only what was created then or later: a date, or a date and time in UTC")
    ] = None
    created_to: Annotated[
        _To | None, Field(description="only what was created until then; of a date without a time, until its end")
    ] = None


class EpisodesQuery(PageQuery, Filtered):
    """The query of a list of episodes."""

    upload_key: Annotated[
        str | None, Field(max_length=200, description="only the episode whose upload had this `Idempotency-Key`")
    ] = None
    left_out: Annotated[
        bool | None, Field(description="true: only episodes that are left out of prompts; false: only the others")
    ] = None
    containing: Annotated[
        str | None,
        Field(alias="q", max_length=500, description="only with this text in the instruction or the note"),
    ] = None
    min_duration_s: Annotated[_Duration | None, Field(description="only recordings at least this long")] = None
    max_duration_s: Annotated[_Duration | None, Field(description="only recordings at most this long")] = None

    def filter(self) -> EpisodeFilter:
        """The store's filter."""
        return EpisodeFilter(**self.model_dump(include=set(EpisodeFilter.__dataclass_fields__)))


class PredictionsQuery(PageQuery, Filtered):
    """The query of a list of predictions."""

    finding: Annotated[
        str | None, Field(pattern=r"^[a-z][a-z0-9-]{0,63}$", description="only with a finding of this code")
    ] = None
    outcome: Annotated[Outcome | None, Field(description="only predictions with this outcome")] = None

    def filter(self) -> PredictionFilter:
        """The store's filter."""
        return PredictionFilter(**self.model_dump(include=set(PredictionFilter.__dataclass_fields__)))
