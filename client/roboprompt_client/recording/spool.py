"""Keep recordings on disk until the service has stored them, so that none is lost or stored twice.

A spool belongs to one user: its folders are 0700 and its files 0600, and only plain files of that user are read.
Another user can neither read a recording nor have another file uploaded.
"""

import json
import logging
import os
import re
import shutil
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import Part, images_of, npy_part, npz_part, scene_json
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError
from roboprompt_client.recording.journal import (
    WRITABLE,
    create_private,
    film_files,
    films_from_journal,
    trajectory_from_journal,
)
from roboprompt_client.robot import Observation
from roboprompt_client.types.film import Film, npz_from_film
from roboprompt_client.types.trajectory import npz_from_trajectory

log = logging.getLogger(__name__)
WAITS_S = (1.0, 2.0, 4.0, 8.0)
# No key or a wrong one, a timeout, too many requests: the service may store the same recording later.
NOT_THE_RECORDINGS_FAULT = (401, 403, 408, 429)
TOO_LARGE = 413
SCENE, JOURNAL, SENT, REFUSED = "scene.json", "journal", "sent.json", "refused.json"
UNFINISHED = "journal.part"  # the journal until the recording has ended as the person wanted
IMAGE = re.compile(r"(?:rgb|depth|mask)_.+\.npy")
OWN_FOLDER = "a folder of roboprompt-robot record that belongs to this user alone"


class Sent(NamedTuple):
    """The service's answer to a recording: the episode's description, or the problem document of a refusal."""

    folder: Path
    stored: bool
    answer: Mapping[str, Any]


class Spool:
    """A folder with a subfolder for each recording, whose name is its idempotency key.

    Raises:
        OSError: if it cannot be made, or belongs to another user.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.chmod(0o700)

    def new(self, task: str, instruction: str, observation: Observation, corrects: str | None = None) -> Path:
        """Write what was seen before a recording; return its folder, into which `UNFINISHED` may follow.

        Args:
            corrects: id of the failed prediction that the recording corrects, if it does.

        Raises:
            InvalidInputError: if it cannot be written, such as on a full disk; nothing is left of it.
        """
        folder = self._folder / uuid4().hex
        scene = {"task": task, "instruction": instruction, "corrects": corrects, **scene_json(observation)}
        try:
            folder.mkdir(mode=0o700)
            for frame in observation.frames:
                for name, image in images_of(frame):
                    file, data, _ = npy_part(name, image, frame)
                    _write(folder / file, data)
            _write(folder / SCENE, json.dumps(scene).encode())
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise InvalidInputError("spool", f"{folder} cannot be written: {error}", WRITABLE) from error
        return folder

    def waiting(self) -> Iterator[Path]:
        """Yield the recordings that were neither stored nor refused, oldest first."""
        folders = [path.parent for path in self._folder.glob(f"*/{JOURNAL}")]
        for folder in sorted(folders, key=lambda path: (path / SCENE).lstat().st_mtime):
            if not (folder / SENT).exists() and not (folder / REFUSED).exists():
                yield folder

    def finish(self, folder: Path) -> None:
        """Let a recording be uploaded, with its films."""
        unfinished = folder / UNFINISHED
        for path in (*film_files(unfinished), unfinished):  # the journal last: it says that all is there
            path.rename(path.with_name(path.name.replace(UNFINISHED, JOURNAL, 1)))

    def finish_all(self) -> None:
        """Let recordings be uploaded that were interrupted."""
        for path in self._folder.glob(f"*/{UNFINISHED}"):
            self.finish(path.parent)

    def discard(self, folder: Path) -> None:
        """Delete a recording."""
        shutil.rmtree(folder)

    def send(self, client: RoboPromptClient, folder: Path, sleep: Callable[[float], None] = time.sleep) -> Sent:
        """Upload a recording, with retries while the service does not answer.

        Films that make it too large for the service are thinned: half of their pictures, a quarter, and so on.

        Raises:
            ServiceUnreachableError: if no retry is answered, or the refusal is temporary; the recording waits.
            InvalidInputError: if the folder is not a recording, or belongs to another user; it stays.
        """
        parts, films, every = *_parts(folder), 1
        waits_s = iter(WAITS_S)
        while True:
            filmed = {film.field: npz_part(film.field, npz_from_film(film.thinned(every))) for film in films}
            try:
                answer = client.upload_parts({**parts, **filmed}, folder.name)
            except ServiceUnreachableError as error:
                if (wait_s := next(waits_s, None)) is None:
                    raise
                log.warning("%s: again in %g s", error, wait_s)
                sleep(wait_s)
            except ServiceProblemError as error:
                if error.status == TOO_LARGE and any(len(film.pictures) > every for film in films):
                    every *= 2
                    log.warning("%s: again with one of %d pictures of each film", error, every)
                    continue
                if error.status >= 500 or error.status in NOT_THE_RECORDINGS_FAULT:
                    raise ServiceUnreachableError(str(error)) from error
                _note(folder / REFUSED, error.problem)
                return Sent(folder, False, error.problem)
            else:
                _note(folder / SENT, {"id": answer["id"]})
                return Sent(folder, True, answer)


def _parts(folder: Path) -> tuple[dict[str, Part], tuple[Film, ...]]:
    """Return a recording's films, and its other parts: metadata, trajectory, and images by the names of their files."""
    _require_own(folder, stat.S_ISDIR)
    try:
        scene = json.loads(_read(folder / SCENE))
    except InvalidInputError:
        raise
    except (OSError, ValueError) as error:
        raise InvalidInputError("recording", f"{folder}: {error}", OWN_FOLDER) from error
    journal = folder / JOURNAL
    for path in (journal, *film_files(journal)):
        _require_own(path, stat.S_ISREG)
    trajectory = npz_from_trajectory(trajectory_from_journal(journal))
    images = sorted(path for path in folder.iterdir() if IMAGE.fullmatch(path.name))
    parts = {
        "metadata": ("metadata.json", json.dumps(scene).encode(), "application/json"),
        "trajectory": npz_part("trajectory", trajectory),
        **{path.stem: (path.name, _read(path), "application/octet-stream") for path in images},
    }
    return parts, films_from_journal(journal)


def _read(path: Path) -> bytes:
    _require_own(path, stat.S_ISREG)
    return path.read_bytes()


def _write(path: Path, data: bytes) -> None:
    with create_private(path) as file:
        file.write(data)


def _note(path: Path, answer: Mapping[str, Any]) -> None:
    """Write that the service has answered; without it the recording is sent again, and stored only once."""
    try:
        _write(path, json.dumps(dict(answer)).encode())
    except OSError as error:
        log.warning("the answer is not noted: %s cannot be written: %s", path, error)


def _require_own(path: Path, is_kind: Callable[[int], bool]) -> None:
    """Refuse links, and files that belong to another user or that another user may write to.

    Raises:
        InvalidInputError: if it is one of these.
        FileNotFoundError: if the path does not exist.
    """
    found = path.lstat()
    others_write = found.st_uid != os.getuid() or bool(found.st_mode & 0o022)
    # a hard link may be to a file of this user that is not a recording
    linked = stat.S_ISREG(found.st_mode) and found.st_nlink > 1
    if not is_kind(found.st_mode) or others_write or linked:
        message = f"{path} is a link, belongs to another user or may be written by others"
        raise InvalidInputError("recording", message, OWN_FOLDER)
