"""Trajectories that claim to be what they are not are refused as such, before they cost anything."""

import pytest

from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from tests.attack.hostile_files import ARCHIVES, GOOD


def test_the_archive_that_they_were_made_from_is_read():
    assert len(trajectory_from_npz(GOOD)) > 1


@pytest.mark.parametrize("name", ARCHIVES)
def test_a_hostile_archive_is_refused(name):
    with pytest.raises(InvalidInputError) as caught:
        trajectory_from_npz(ARCHIVES[name])
    assert caught.value.field.startswith("trajectory")
