"""Recordings that stay on disk until the service has stored them: none is lost, and none is stored twice.

A spool belongs to one user: its folders are 0700 and its files 0600, and only plain files of that user are read, so
that another user can neither see a recording nor make it upload anything else.
"""

import json
import logging
import os
import re
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.http.encoding import Part, request_parts, scene_json
from roboprompt_client.recording.recorder import create_private, trajectory_from_journal
from roboprompt_client.robot import Observation
from roboprompt_client.types.trajectory import Trajectory
from roboprompt_client.types.trajectory_npz import npz_from_trajectory

log = logging.getLogger(__name__)
WAITS_S = (1.0, 2.0, 4.0, 8.0)
# No or a wrong key, too slow, too many requests: the same recording may be stored later.
NOT_THE_RECORDINGS_FAULT = (401, 403, 408, 429)
SCENE, JOURNAL, SENT, REFUSED = "scene.json", "journal", "sent.json", "refused.json"
TRAJECTORY = "trajectory.npz"  # instead of a journal
IMAGE = re.compile(r"(?:rgb|depth|mask)_.+\.npy")
OWN_FOLDER = "a folder of roboprompt-robot record that belongs to this user alone"


class Sent(NamedTuple):
    """A recording that the service answered: with the episode's description, or the problem document of a refusal."""

    folder: Path
    stored: bool
    answer: Mapping[str, Any]


class Spool:
    """A folder with a folder for each recording, whose name is its idempotency key.

    Raises:
        OSError: if it cannot be made, or belongs to another user.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.chmod(0o700)

    def new(self, task: str, instruction: str, observation: Observation, **more: Any) -> Path:  # noqa: ANN401
        """A place for a recording that begins: what was seen is written, and its `journal` may follow.

        Args:
            more: further members of the upload's metadata.
        """
        folder = self._folder / uuid4().hex
        folder.mkdir(mode=0o700)
        for file, data, _ in request_parts({}, observation.frames).values():
            if IMAGE.fullmatch(file):
                _write(folder / file, data)
        scene = {"task": task, "instruction": instruction, **scene_json(observation, None), **more}
        _write(folder / SCENE, json.dumps(scene).encode())
        return folder

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
        more = {"control_frequency_hz": control_frequency_hz, "extra": dict(extra or {})}
        folder = self.new(task, instruction, observation, **more)
        begun = folder / f"{TRAJECTORY}.part"  # half a trajectory is never sent
        _write(begun, npz_from_trajectory(trajectory))
        begun.replace(folder / TRAJECTORY)
        return folder

    def waiting(self) -> Iterator[Path]:
        """The recordings that were neither stored nor refused, oldest first."""
        folders = [path.parent for name in (JOURNAL, TRAJECTORY) for path in self._folder.glob(f"*/{name}")]
        for folder in sorted(folders, key=lambda path: (path / SCENE).lstat().st_mtime):
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
            ServiceUnreachableError: if it never does, or refuses this robot at present; the recording waits.
            InvalidInputError: if it is not a recording, or another user's; it stays where it is.
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
                _write(folder / REFUSED, json.dumps(dict(error.problem)).encode())
                return Sent(folder, False, error.problem)
            else:
                _write(folder / SENT, json.dumps({"id": answer["id"]}).encode())
                return Sent(folder, True, answer)
        raise AssertionError("the last attempt returns or raises")


def _parts(folder: Path) -> dict[str, Part]:
    """The parts of `POST /episodes`: the scene, its images by the names of their files, and the trajectory."""
    _require_own(folder, stat.S_ISDIR)
    try:
        scene = json.loads(_read(folder / SCENE))
    except InvalidInputError:
        raise
    except (OSError, ValueError) as error:
        raise InvalidInputError("recording", f"{folder}: {error}", OWN_FOLDER) from error
    whole, journal = folder / TRAJECTORY, folder / JOURNAL
    if whole.exists():
        trajectory = _read(whole)
    else:
        _require_own(journal, stat.S_ISREG)
        trajectory = npz_from_trajectory(trajectory_from_journal(journal))
    images = sorted(path for path in folder.iterdir() if IMAGE.fullmatch(path.name))
    return {
        "metadata": ("metadata.json", json.dumps(scene).encode(), "application/json"),
        "trajectory": (TRAJECTORY, trajectory, "application/octet-stream"),
        **{path.stem: (path.name, _read(path), "application/octet-stream") for path in images},
    }


def _read(path: Path) -> bytes:
    _require_own(path, stat.S_ISREG)
    return path.read_bytes()


def _write(path: Path, data: bytes) -> None:
    with create_private(path) as file:
        file.write(data)


def _require_own(path: Path, is_kind: Callable[[int], bool]) -> None:
    """Refuse links, what belongs to another user, and what another user may write to.

    Raises:
        InvalidInputError: as said.
        FileNotFoundError: if there is nothing.
    """
    found = path.lstat()
    others_write = os.name == "posix" and (found.st_uid != os.getuid() or bool(found.st_mode & 0o022))
    # A second name of a file: of one that this user can read, but that was never recorded.
    linked = stat.S_ISREG(found.st_mode) and found.st_nlink > 1
    if not is_kind(found.st_mode) or others_write or linked:
        message = f"{path} is a link, belongs to another user or may be written by others"
        raise InvalidInputError("recording", message, OWN_FOLDER)
