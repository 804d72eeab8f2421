"""What the user says about a dataset beside where it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.datasets.limits import ReadLimits
from app.datasets.objects import KnownObjects
from app.pipeline.wording import NAME_PATTERN


@dataclass(frozen=True)
class ImportOptions:
    """What holds for every episode.

    Attributes:
        task, instruction: instead of what the dataset says.
        objects: what the dataset does not tell.
        cameras: only these; None for all.
        features: what the user says of the mapping of columns, as JSON; formats that have no columns take none.
        limits: how much an episode may take.
    """

    task: str | None = None
    instruction: str | None = None
    objects: KnownObjects = field(default_factory=KnownObjects)
    cameras: tuple[str, ...] | None = None
    features: Mapping[str, Any] = field(default_factory=dict)
    limits: ReadLimits = field(default_factory=ReadLimits)

    def wants(self, camera: str) -> bool:
        """Whether the camera's images are to be imported."""
        return self.cameras is None or camera in self.cameras


def as_name(text: str) -> str:
    """`text` with what a name must not have replaced by an underscore; may still be refused as a name."""
    allowed = "".join(letter if letter.isascii() and (letter.isalnum() or letter in " _-.") else "_" for letter in text)
    name = allowed.strip(" _-.")[:64].strip(" _-.")
    return name if NAME_PATTERN.fullmatch(name) else text
