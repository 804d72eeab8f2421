"""An archive whose parts are not what an export writes is named as damaged; nothing of it ends the importer."""

import hashlib
import json
import time
import zipfile

import pytest

from app.cli.import_data import check_dataset
from app.datasets.bounds import DatasetError
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions
from roboprompt_client.errors import InvalidInputError

METADATA = {"task": "pick", "instruction": "x", "objects": [{"name": "cube", "position": [0, 0, 0]}]}


def archive(path, metadata=METADATA, trajectory=b"", task="pick", settings=None, compression=zipfile.ZIP_STORED):
    files = {
        "task.json": json.dumps({} if settings is None else settings).encode(),
        "episodes/000000/metadata.json": json.dumps(metadata).encode(),
        "episodes/000000/trajectory.npz": trajectory,
    }
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    manifest = {"format": "roboprompt-task", "version": 1, "task": task, "files": digests}
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, data in {**files, "manifest.json": json.dumps(manifest).encode()}.items():
            file.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        ([], "names no task"),
        ({}, "names no task"),
        ({**METADATA, "task": "../keys"}, "task"),
        ({**METADATA, "objects": "cube"}, "objects without names"),
        ({**METADATA, "objects": [{}]}, "objects without names"),
        ({**METADATA, "cameras": [7]}, "cameras without names"),
        (METADATA, "trajectory"),
    ],
)
def test_an_episode_that_no_export_writes_is_one_bad_result(tmp_path, metadata, reason):
    (result,) = check_dataset(open_dataset(archive(tmp_path / "a.zip", metadata), ImportOptions()))
    assert result.status in ("damaged", "refused")
    assert reason in result.detail


def test_many_absent_episodes_take_no_longer_than_their_list(tmp_path):
    digests = {"task.json": hashlib.sha256(b"{}").hexdigest()}
    digests |= {f"episodes/{number:06d}/metadata.json": "0" * 64 for number in range(150_000)}
    manifest = {"format": "roboprompt-task", "version": 1, "task": "pick", "files": digests}
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as file:
        for name, data in {"task.json": b"{}", "manifest.json": json.dumps(manifest)}.items():
            file.writestr(name, data)
        for number in range(20_000):
            file.writestr(f"other/{number}", b"")
    begun_s = time.process_time()
    dataset = open_dataset(tmp_path / "a.zip", ImportOptions())
    assert (len(dataset.entries), len(dataset.damaged)) == (0, 150_000)
    assert time.process_time() - begun_s < 10


@pytest.mark.parametrize("task", ["../keys", "a/b", "x" * 65, "a?b=c"])
def test_a_task_that_would_be_another_address_of_the_service(tmp_path, task):
    with pytest.raises(InvalidInputError, match="task"):
        open_dataset(archive(tmp_path / "a.zip", task=task), ImportOptions())


@pytest.mark.parametrize("settings", [[], {"task": "other"}])
def test_invalid_settings_are_refused(tmp_path, settings):
    with pytest.raises(DatasetError, match="no task's settings"):
        open_dataset(archive(tmp_path / "a.zip", settings=settings), ImportOptions())


@pytest.mark.parametrize("compression", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_compressions_whose_memory_nothing_bounds(tmp_path, compression):
    with pytest.raises(DatasetError, match="neither stored nor deflated"):
        open_dataset(archive(tmp_path / "a.zip", compression=compression), ImportOptions())


def test_what_a_file_says_moves_no_terminals_cursor(tmp_path):
    (entry,) = open_dataset(archive(tmp_path / "a.zip", {**METADATA, "task": "\x1b[2J"}), ImportOptions()).entries
    with pytest.raises((DatasetError, InvalidInputError)) as caught:
        entry.read()
    assert "\x1b" not in str(caught.value)
    with pytest.raises(DatasetError) as caught:
        open_dataset(archive(tmp_path / "\x1b[2J.zip", settings=[]), ImportOptions())
    assert "\x1b" not in str(caught.value)
