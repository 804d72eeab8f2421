"""Recordings on disk until the service has them: whatever goes wrong, none is lost and none is stored twice."""

import json
import logging
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import request_parts, scene_json
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.recorder import trajectory_from_journal
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import Trajectory
from roboprompt_client.trajectory_npz import npz_from_trajectory

log = logging.getLogger(__name__)
WAITS_S = (1.0, 2.0, 4.0, 8.0)
# No or a wrong key, too slow, too many requests: the same recording may be stored later.
NOT_THE_RECORDINGS_FAULT = (401, 403, 408, 429)
SCENE, JOURNAL, SENT, REFUSED = "scene.json", "journal", "sent.json", "refused.json"
TRAJECTORY = "trajectory.npz"  # instead of a journal


@dataclass(frozen=True)
class Sent:
    """A recording that the service answered.

    Attributes:
        answer: the episode's description, or the problem document of a refusal.
    """

    folder: Path
    stored: bool
    answer: Mapping[str, Any]


class Spool:
    """A folder with a folder for each recording, whose name is its idempotency key."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def new(self, task: str, instruction: str, observation: Observation) -> Path:
        """A place for a recording that begins: what was seen is written, and its `journal` may follow."""
        return self._new({"task": task, "instruction": instruction, **scene_json(observation, None)}, observation)

    def keep(
        self,
        task: str,
        instruction: str,
        observation: Observation,
        trajectory: Trajectory,
        *,
        control_frequency_hz: float = 20.0,
        extra: Mapping[str, Any] | None = None,
    ) -> Path:
        """Write a recording that is whole already; arguments as for `RoboPromptClient.upload`."""
        metadata = {"task": task, "instruction": instruction, **scene_json(observation, None)}
        metadata |= {"control_frequency_hz": control_frequency_hz, "extra": dict(extra or {})}
        folder = self._new(metadata, observation)
        begun = folder / f"{TRAJECTORY}.part"  # half a trajectory is never sent
        begun.write_bytes(npz_from_trajectory(trajectory))
        begun.replace(folder / TRAJECTORY)
        return folder

    def _new(self, metadata: dict[str, Any], observation: Observation) -> Path:
        folder = self._folder / uuid4().hex
        folder.mkdir()
        for name, (file, data, kind) in request_parts(metadata, observation.frames).items():
            if name != "metadata":
                metadata.setdefault("parts", {})[name] = [file, kind]
                (folder / file).write_bytes(data)
        (folder / SCENE).write_text(json.dumps(metadata))
        return folder

    def waiting(self) -> Iterator[Path]:
        """The recordings that were neither stored nor refused, oldest first."""
        folders = [path.parent for name in (JOURNAL, TRAJECTORY) for path in self._folder.glob(f"*/{name}")]
        for folder in sorted(folders, key=lambda path: (path / SCENE).stat().st_mtime):
            if not (folder / SENT).exists() and not (folder / REFUSED).exists():
                yield folder

    def discard(self, folder: Path) -> None:
        """Remove a recording that a person does not want."""
        for file in folder.iterdir():
            file.unlink()
        folder.rmdir()

    def send(self, client: RoboPromptClient, folder: Path, sleep: Callable[[float], None] = time.sleep) -> Sent:
        """Upload one, again and again while the service does not answer.

        Raises:
            ServiceUnreachableError: if it never does, or takes nothing from this robot at present; the recording waits.
            InvalidInputError: if the recording is none; it stays where it is.
        """
        parts = _parts(folder)
        for wait_s in (*WAITS_S, None):
            try:
                answer = client.upload_parts(parts, folder.name)
            except ServiceUnreachableError as error:
                if wait_s is None:
                    raise
                log.warning("%s: again in %g s", error, wait_s)
                sleep(wait_s)
            except ServiceProblemError as error:
                if error.status >= 500 or error.status in NOT_THE_RECORDINGS_FAULT:
                    raise ServiceUnreachableError(str(error)) from error
                (folder / REFUSED).write_text(json.dumps(dict(error.problem)))
                return Sent(folder, False, error.problem)
            else:
                (folder / SENT).write_text(json.dumps({"id": answer["id"]}))
                return Sent(folder, True, answer)
        raise AssertionError("the last attempt returns or raises")


def _parts(folder: Path) -> dict[str, tuple[str, bytes, str]]:
    try:
        metadata = json.loads((folder / SCENE).read_text())
    except (OSError, ValueError) as error:
        raise InvalidInputError("recording", f"{folder}: {error}", "a folder of roboprompt-robot record") from error
    listed = metadata.pop("parts", {})
    parts = {name: (file, (folder / file).read_bytes(), kind) for name, (file, kind) in listed.items()}
    trajectory = _trajectory_npz(folder)
    document = json.dumps(metadata).encode()
    return {
        "metadata": ("metadata.json", document, "application/json"),
        "trajectory": ("trajectory.npz", trajectory, "application/octet-stream"),
        **parts,
    }


def _trajectory_npz(folder: Path) -> bytes:
    whole = folder / TRAJECTORY
    return whole.read_bytes() if whole.exists() else npz_from_trajectory(trajectory_from_journal(folder / JOURNAL))
