import pytest

from app.datasets.apart import open_apart, open_dataset
from app.datasets.archive import write_archive
from app.datasets.bounds import DatasetError
from app.datasets.options import ImportOptions
from roboprompt_client.errors import InvalidInputError
from tests.datasets.parcels import parcels


@pytest.fixture
def archive(tmp_path):
    write_archive(tmp_path / "pick.zip", "pick", {"num_demonstrations": 5}, parcels())
    return tmp_path / "pick.zip"


def test_episodes_are_those_that_are_read_here(archive):
    here = open_dataset(archive, ImportOptions())
    with open_apart(archive, ImportOptions()) as apart:
        assert (apart.format, apart.task_settings) == (here.format, here.task_settings)
        for ours, theirs in zip(here.entries, apart.entries, strict=True):
            mine, other = ours.read(), theirs.read()
            assert (ours.name, mine.key, mine.files) == (theirs.name, other.key, other.files)


def test_errors_are_those_that_are_raised_here(archive, tmp_path):
    with (
        pytest.raises(DatasetError, match=r"nothing\.zip does not exist"),
        open_apart(tmp_path / "nothing.zip", ImportOptions()),
    ):
        pass
    with pytest.raises(InvalidInputError) as refused, open_apart(archive, ImportOptions(task="a/b")):
        pass
    assert refused.value.field == "task"


def reader_of(dataset):
    return dataset.entries[0].read.args[0]


def test_a_reader_that_dies_costs_its_episode_and_another_takes_over(archive):
    with open_apart(archive, ImportOptions()) as dataset:
        reader_of(dataset)._child[0].kill()
        with pytest.raises(DatasetError, match="its reader ended with SIGKILL"):
            dataset.entries[0].read()
        assert dataset.entries[1].read().metadata["task"]


def test_no_reader_outlives_its_dataset(archive):
    with open_apart(archive, ImportOptions()) as dataset:
        process, _ = reader_of(dataset)._child
        assert process.poll() is None
    assert process.returncode is not None
