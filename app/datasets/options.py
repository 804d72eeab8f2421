"""Options of an import, the objects that a dataset does not contain among them.

The file of objects has names, mask ids and poses. It is one list for all episodes, or an object with any of `default`,
`variations` and `episodes`, of which the most specific one is used:

    {"default": [{"name": "drawer", "mask_ids": [98]}],
     "variations": {"1": [{"name": "drawer", "mask_ids": [105]}]},
     "episodes": {"episode7": [{"name": "drawer", "position": [0.2, 0.0, 1.1], "quaternion_xyzw": [0, 0, 0, 1]}]}}

RLBench records the poses of a task's objects in `task_low_dim_state`: with `"low_dim_state": 7` the object's pose
(x y z, quaternion xyzw) begins at index 7.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.datasets.bounds import MAX_UNPACKED_BYTES, DatasetError
from app.datasets.parcel import ObjectEntry
from roboprompt_client.types.names import NAME_PATTERN

Objects = tuple[ObjectEntry, ...]
GROUPS = ("default", "variations", "episodes")
_FIELDS = {"name", "position", "quaternion_xyzw", "mask_ids", "low_dim_state"}


@dataclass(frozen=True)
class KnownObjects:
    """The objects of a dataset's scenes."""

    default: Objects = ()
    variations: Mapping[str, Objects] = field(default_factory=dict)
    episodes: Mapping[str, Objects] = field(default_factory=dict)

    def of(self, episode: str, variation: int | None = None) -> Objects:
        """Return the objects of an episode; none if the file has none for it.

        Args:
            episode: its name in the dataset; an entry `episode7` also matches `open_drawer/episodes/episode7`.
        """
        for name in (episode, episode.rpartition("/")[2]):
            if name in self.episodes:
                return self.episodes[name]
        return self.variations.get(str(variation), self.default)


@dataclass(frozen=True)
class ImportOptions:
    """Options for every episode.

    Attributes:
        task, instruction: override those of the dataset.
        objects: that the dataset does not contain.
        features: changes of the mapping of columns, as JSON, for formats with columns.
        max_unpacked_bytes: of an episode, or of the list of episodes.
    """

    task: str | None = None
    instruction: str | None = None
    objects: KnownObjects = field(default_factory=KnownObjects)
    features: Mapping[str, Any] = field(default_factory=dict)
    max_unpacked_bytes: int = MAX_UNPACKED_BYTES

    @property
    def given(self) -> dict[str, str]:
        """The parts of an episode's metadata that the user overrides."""
        said = {"task": self.task, "instruction": self.instruction}
        return {name: value for name, value in said.items() if value is not None}


def read_objects(path: Path) -> KnownObjects:
    """Read a file of objects; raises DatasetError naming the file and the fault."""
    try:
        document = json.loads(path.read_text())
        if isinstance(document, list):
            document = {"default": document}
        if unknown := set(document) - {*GROUPS}:
            raise ValueError(f"{sorted(unknown)[0]!r} is none of {', '.join(GROUPS)}")
        groups = (document.get(kind, {}) for kind in GROUPS[1:])
        named = [{name: tuple(map(_object, items)) for name, items in group.items()} for group in groups]
        return KnownObjects(tuple(map(_object, document.get("default", []))), *named)
    except (OSError, ValueError, TypeError, AttributeError) as error:
        expected = f"it must be a list of objects or have {', '.join(GROUPS)}"
        raise DatasetError(f"{path}: {error}; {expected}") from error


def _object(item: Mapping[str, Any]) -> ObjectEntry:
    if unknown := set(item) - _FIELDS:
        raise ValueError(f"{sorted(unknown)[0]!r} is none of {', '.join(sorted(_FIELDS))}")
    if "name" not in item:
        raise ValueError(f"an object has no name: {dict(item)}")
    position, quaternion, low_dim_state = (item.get(name) for name in ("position", "quaternion_xyzw", "low_dim_state"))
    return ObjectEntry(
        item["name"],
        None if position is None else tuple(map(float, position)),
        None if quaternion is None else tuple(map(float, quaternion)),
        tuple(map(int, item.get("mask_ids", ()))),
        None if low_dim_state is None else int(low_dim_state),
    )


def as_name(text: str) -> str:
    """Return `text` with characters that names must not have replaced by underscores; it may still be invalid."""
    allowed = "".join(letter if letter.isascii() and (letter.isalnum() or letter in " _-.") else "_" for letter in text)
    name = allowed.strip(" _-.")[:64].strip(" _-.")
    return name if NAME_PATTERN.fullmatch(name) else text


def read_mapping(path: Path) -> dict[str, Any]:
    """Return the mapping of columns of a JSON file; raises DatasetError."""
    try:
        return dict(json.loads(path.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise DatasetError(f"{path}: {error}") from error
