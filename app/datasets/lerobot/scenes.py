"""What a LeRobot dataset has no place for: objects, calibrated cameras and their first images, beside its own files.

meta/roboprompt/episode_000000/metadata.json   as it was uploaded
rgb_front       the image files, byte for byte
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.datasets.bounds import Budget, DamagedError, read_inside
from app.datasets.recording import canonical_json, checked_metadata

FOLDER = Path("meta/roboprompt")
METADATA = "metadata.json"


@dataclass(frozen=True, eq=False)
class Scene:
    """An episode's metadata and its image files by the names of their parts."""

    metadata: Mapping[str, Any]
    images: Mapping[str, bytes]


def read_scene(root: Path, index: int, budget: Budget) -> Scene | None:
    """The scene of the episode, or None if the dataset does not carry it.

    Raises:
        DamagedError: naming the file that cannot be read.
    """
    folder = _folder(root, index)
    if not folder.exists():
        return None
    path = folder / METADATA
    try:
        metadata = checked_metadata(path, json.loads(read_inside(root, path, budget)))
    except ValueError as error:
        raise DamagedError(path, f"is not JSON: {error}") from error
    names = sorted(item.name for item in folder.iterdir() if item.name != METADATA)
    return Scene(metadata, {name: read_inside(root, folder / name, budget) for name in names})


def write_scene(root: Path, index: int, scene: Scene) -> None:
    """The inverse of `read_scene`."""
    folder = _folder(root, index)
    folder.mkdir(parents=True)
    (folder / METADATA).write_bytes(canonical_json(scene.metadata))
    for name, data in scene.images.items():
        (folder / name).write_bytes(data)


def _folder(root: Path, index: int) -> Path:
    return root / FOLDER / f"episode_{int(index):06d}"
