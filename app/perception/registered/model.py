"""What a task's settings hold of a registered object: where its template is stored, and how it came about."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from app.perception.object_model import MIN_CONFIDENCE, Checked, Confidence, ObjectModel
from app.perception.strict import WHOLE, Number, Truth
from roboprompt_client.errors import InvalidInputError

SYMMETRIES = '"none", "yaw" (the same all around), or degrees of a turn that leaves it unchanged, e.g. 180'
MIN_SYMMETRY_DEG = 30.0  # what is rounder is round
Share = Annotated[Number, Field(ge=0, le=1)]
Symmetric = Annotated[Literal["none", "yaw"] | Number, Field(description=SYMMETRIES)]


@dataclass(frozen=True)
class LeftOutView(Checked):
    """A labelled view that the template does not have.

    Attributes:
        label: its id.
        reason: why, in words.
    """

    label: str
    reason: str


@dataclass(frozen=True)
class RegisteredModel(ObjectModel):
    """An object by what it looked like in labelled views; teaching makes it, see `POST /tasks/{name}/labels/learn`.

    Attributes:
        template: SHA-256 of the stored template.
        symmetric: which turns about the vertical leave it unchanged.
        yaw_may_be_unknown: give a pose without rotation where the images do not decide the yaw; refused otherwise.
        views: the labels whose views the template has.
        scores: 0..1, how well each further view agreed with those before.
        left_out: the labels whose views did not fit.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["registered"] = field(default="registered", kw_only=True)
    template: Annotated[str, Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of a template, as teaching gives it")]
    symmetric: Symmetric = "none"
    yaw_may_be_unknown: Truth = False
    views: Annotated[tuple[str, ...], Field(max_length=100)] = ()
    scores: Annotated[tuple[Share, ...], Field(max_length=100)] = ()
    left_out: Annotated[tuple[LeftOutView, ...], Field(max_length=100)] = ()
    num_points: Annotated[int, Field(ge=0), WHOLE] = 0
    min_confidence: Confidence = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        yaw_symmetry_deg(self.symmetric)


def yaw_symmetry_deg(symmetric: str | float) -> float | None:
    """The turn about z that leaves pose and looks unchanged: 0 any, None none.

    Raises:
        InvalidInputError: if no number of such turns makes a whole one.
    """
    if isinstance(symmetric, str):
        return None if symmetric == "none" else 0.0
    turns = 360 / symmetric if symmetric else 0
    if not (MIN_SYMMETRY_DEG <= symmetric <= 180 and abs(turns - round(turns)) < 1e-9):
        raise InvalidInputError("symmetric", f"is {symmetric!r}", SYMMETRIES)
    return float(symmetric)
