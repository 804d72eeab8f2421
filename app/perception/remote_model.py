"""What the estimator `remote` knows of an object: which server finds it, and what to tell that server."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import httpx

from app.perception.object_model import MIN_CONFIDENCE, ObjectModel, number
from app.pipeline.errors import InvalidInputError

MAX_TIMEOUT_S = 300.0


@dataclass(frozen=True)
class RemoteModel(ObjectModel):
    """An object that a server finds.

    Attributes:
        url: the whole address that images are posted to, e.g. ``http://gpu-box:8000/poses``.
        timeout_s: the answer comes within it, retries included, or the server counts as unavailable.
        model: what the server wants to know of the object; sent as it is. Another instance of this service wants an
            object model, e.g. a `CuboidModel`'s JSON; a FoundationPose wrapper perhaps ``{"mesh": "mug.obj"}``.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["remote"] = field(default="remote", init=False)
    url: str
    timeout_s: float = 10.0
    model: Mapping[str, Any] | None = None
    min_confidence: float = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        _check_url(self.url)
        valid = f"seconds, above 0 and up to {MAX_TIMEOUT_S:g}"
        if number("timeout_s", self.timeout_s, valid=valid, low=0.0, high=MAX_TIMEOUT_S) == 0:
            raise InvalidInputError("timeout_s", f"is {self.timeout_s!r}", valid)
        number("min_confidence", self.min_confidence, valid="a number in 0..1", low=0.0, high=1.0)
        if self.model is not None and not isinstance(self.model, Mapping):
            raise InvalidInputError("model", f"is {self.model!r}", "a JSON object, or null")


def _check_url(url: object) -> None:
    valid = "an address like http://127.0.0.1:8000/poses"
    try:
        parsed = httpx.URL(url) if isinstance(url, str) else httpx.URL("")
    except httpx.InvalidURL as error:
        raise InvalidInputError("url", f"is {url!r}: {error}", valid) from None
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise InvalidInputError("url", f"is {url!r}", valid)
    if parsed.userinfo:
        raise InvalidInputError("url", "has a user name or password in it, which everyone can read", valid)
