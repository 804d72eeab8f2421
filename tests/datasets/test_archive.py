import zipfile

import pytest

from app.datasets.archive import write_archive
from app.datasets.bounds import DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions
from roboprompt_client.errors import InvalidInputError
from tests.datasets.parcels import parcel, parcels

SETTINGS = {"num_demonstrations": 5}


@pytest.fixture
def archive(tmp_path):
    assert write_archive(tmp_path / "pick.zip", "pick", SETTINGS, parcels()) == 3
    return tmp_path / "pick.zip"


def rewrite(path, change):
    """The archive with its members as `change` makes them; None leaves one out."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            if (changed := change(name, data)) is not None:
                archive.writestr(name, changed)


def test_what_goes_in_comes_out(archive):
    dataset = open_dataset(archive, ImportOptions())
    assert dataset.task_settings == {"pick": SETTINGS}
    for before, entry in zip(parcels(), dataset.entries, strict=True):
        after = entry.read()
        assert after.files == before.files
        assert after.metadata == before.metadata
        assert after.key == before.key


def test_the_same_task_gives_the_same_bytes(archive, tmp_path):
    write_archive(tmp_path / "again.zip", "pick", SETTINGS, parcels())
    assert (tmp_path / "again.zip").read_bytes() == archive.read_bytes()


def test_another_name_for_the_task(archive):
    dataset = open_dataset(archive, ImportOptions(task="pick_2"))
    assert dataset.task_settings == {"pick_2": SETTINGS}
    assert dataset.entries[0].read().metadata["task"] == "pick_2"


def test_a_changed_file_is_named_and_the_others_are_read(archive):
    rewrite(archive, lambda name, data: data[:-1] if name == "episodes/000001/rgb_front" else data)
    first, second, _ = open_dataset(archive, ImportOptions()).entries
    assert first.read().metadata["instruction"] == "pick up the cube"
    with pytest.raises(DamagedError, match="episodes/000001/rgb_front: does not match its SHA-256"):
        second.read()


def test_a_missing_file_is_named(archive):
    rewrite(archive, lambda name, data: None if name == "episodes/000002/trajectory.npz" else data)
    dataset = open_dataset(archive, ImportOptions())
    assert len(dataset.entries) == 2
    assert dataset.damaged == ("episodes/000002: episodes/000002/trajectory.npz is not in the archive",)


def test_an_episode_of_another_task_is_refused_with_both_names(tmp_path):
    write_archive(tmp_path / "mixed.zip", "pick", SETTINGS, [parcel(), parcel(task="push")])
    own, other = open_dataset(tmp_path / "mixed.zip", ImportOptions()).entries
    assert own.read().metadata["task"] == "pick"
    with pytest.raises(InvalidInputError, match="episode is of task 'push', the archive of task 'pick'"):
        other.read()
    _, given = open_dataset(tmp_path / "mixed.zip", ImportOptions(task="both")).entries
    assert given.read().metadata["task"] == "both"


def test_what_is_no_archive(archive):
    rewrite(archive, lambda name, data: b'{"format": "holiday", "version": 1}' if name == "manifest.json" else data)
    with pytest.raises(DatasetError, match="is holiday 1, expected roboprompt-task 1"):
        open_dataset(archive, ImportOptions())
    rewrite(archive, lambda name, data: None if name == "manifest.json" else data)
    with pytest.raises(DatasetError, match="is no archive of a task"):
        open_dataset(archive, ImportOptions())


def test_an_interrupted_export_leaves_nothing(tmp_path):
    def broken():
        yield from parcels()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_archive(tmp_path / "pick.zip", "pick", SETTINGS, broken())
    assert list(tmp_path.iterdir()) == []
