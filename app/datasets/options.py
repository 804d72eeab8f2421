"""What the user says about a dataset beside where it is, and the file that tells of objects what a dataset does not.

That file gives names, ids in the masks, and poses. It is either one list for every episode, or an object with any of
`default`, `variations` and `episodes`, the more specific first:

    {"default": [{"name": "drawer", "mask_ids": [98]}],
     "variations": {"1": [{"name": "drawer", "mask_ids": [105]}]},
     "episodes": {"episode7": [{"name": "drawer", "position": [0.2, 0.0, 1.1], "quaternion_xyzw": [0, 0, 0, 1]}]}}

RLBench records the poses of a task's objects one after the other in `task_low_dim_state`: `"low_dim_state": 7` says
that the object's pose (x y z, quaternion xyzw) begins at number 7 there.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.datasets.bounds import DatasetError, ReadLimits
from app.datasets.parcel import ObjectEntry
from roboprompt_client.wording import NAME_PATTERN

Objects = tuple[ObjectEntry, ...]
_FIELDS = {"name", "position", "quaternion_xyzw", "mask_ids", "low_dim_state"}


@dataclass(frozen=True)
class KnownObjects:
    """The objects of a dataset's scenes."""

    default: Objects = ()
    variations: Mapping[str, Objects] = field(default_factory=dict)
    episodes: Mapping[str, Objects] = field(default_factory=dict)

    def of(self, episode: str, variation: int | None = None) -> Objects:
        """The objects of an episode; none if the file does not tell.

        Args:
            episode: its name in the dataset; an entry `episode7` also matches `open_drawer/episodes/episode7`.
        """
        for name in (episode, episode.rpartition("/")[2]):
            if name in self.episodes:
                return self.episodes[name]
        return self.variations.get(str(variation), self.default)


def read_objects(path: Path) -> KnownObjects:
    """Read such a file; raises DatasetError naming the file and what is wrong with it."""
    try:
        document = json.loads(path.read_text())
        if isinstance(document, list):
            return KnownObjects(_objects(document))
        if unknown := set(document) - {"default", "variations", "episodes"}:
            raise ValueError(f"{sorted(unknown)[0]!r} is none of default, variations, episodes")
        groups = (document.get(kind, {}) for kind in ("variations", "episodes"))
        named = [{name: _objects(items) for name, items in group.items()} for group in groups]
        return KnownObjects(_objects(document.get("default", [])), *named)
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{path}: {error}; it must be a list of objects or have default, variations, episodes"
        ) from error


def _objects(items: list[Mapping[str, Any]]) -> Objects:
    return tuple(_object(item) for item in items)


def _object(item: Mapping[str, Any]) -> ObjectEntry:
    if unknown := set(item) - _FIELDS:
        raise ValueError(f"{sorted(unknown)[0]!r} is none of {', '.join(sorted(_FIELDS))}")
    if "name" not in item:
        raise ValueError(f"an object has no name: {dict(item)}")
    position, quaternion = item.get("position"), item.get("quaternion_xyzw")
    return ObjectEntry(
        item["name"],
        None if position is None else tuple(map(float, position)),
        None if quaternion is None else tuple(map(float, quaternion)),
        tuple(map(int, item.get("mask_ids", ()))),
        None if item.get("low_dim_state") is None else int(item["low_dim_state"]),
    )


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

    @property
    def given(self) -> dict[str, str]:
        """Of an episode's metadata, what the user says instead."""
        said = {"task": self.task, "instruction": self.instruction}
        return {name: value for name, value in said.items() if value is not None}

    def wants(self, camera: str) -> bool:
        """Whether the camera's images are to be imported."""
        return self.cameras is None or camera in self.cameras


def as_name(text: str) -> str:
    """`text` with what a name must not have replaced by an underscore; may still be refused as a name."""
    allowed = "".join(letter if letter.isascii() and (letter.isalnum() or letter in " _-.") else "_" for letter in text)
    name = allowed.strip(" _-.")[:64].strip(" _-.")
    return name if NAME_PATTERN.fullmatch(name) else text
