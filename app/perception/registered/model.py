"""The object model of `registered` in a task's settings: which template is stored, and how it was learned."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from app.perception.object_model import MIN_CONFIDENCE, WHOLE, Checked, Confidence, ObjectModel, Share, Truth
from roboprompt_client.errors import InvalidInputError

SYMMETRIES = '"none", "yaw" (the same all around), or degrees of a turn that leaves it unchanged, e.g. 180'
MIN_SYMMETRY_DEG = 30.0  # an object with a smaller symmetry counts as round


def yaw_symmetry_deg(symmetric: str | float) -> float | None:
    """Return the rotation symmetry about z in degrees: 0 round, None none.

    Raises:
        InvalidInputError: if `symmetric` is neither "none" nor "yaw" nor a divisor of 360.
    """
    if symmetric in ("none", "yaw"):
        return None if symmetric == "none" else 0.0
    if isinstance(symmetric, bool) or not isinstance(symmetric, int | float):
        raise InvalidInputError("", f"is {symmetric!r:.80}", SYMMETRIES)
    turns = 360 / symmetric if symmetric else 0
    if not (MIN_SYMMETRY_DEG <= symmetric <= 180 and abs(turns - round(turns)) < 1e-9):
        raise InvalidInputError("", f"is {symmetric!r}", SYMMETRIES)
    return float(symmetric)


def _checked(symmetric: str | float) -> str | float:
    yaw_symmetry_deg(symmetric)
    return symmetric if isinstance(symmetric, str) else float(symmetric)


Symmetric = Annotated[
    str | float,
    BeforeValidator(_checked, json_schema_input_type=Literal["none", "yaw"] | float),
    Field(description=SYMMETRIES),
]


@dataclass(frozen=True)
class LeftOutView(Checked):
    """A labeled view that was not merged into the template.

    Attributes:
        label: its id.
        reason: why not.
    """

    label: str
    reason: str


@dataclass(frozen=True)
class RegisteredModel(ObjectModel):
    """An object that was taught by labeled views, see `POST /tasks/{name}/labels/learn`.

    Attributes:
        template: SHA-256 of the stored template.
        symmetric: its rotation symmetry about the vertical.
        yaw_may_be_unknown: give a pose without rotation where the images do not decide the yaw; refused otherwise.
        views: the labels whose views were merged.
        scores: 0..1, how well each further view agreed with those before.
        left_out: the labels whose views were not merged.
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

    @property
    def yaw_symmetry_deg(self) -> float | None:
        """The rotation symmetry about z in degrees: 0 round, None none."""
        return yaw_symmetry_deg(self.symmetric)
