import numpy as np
import pytest

from app.perception.base import GivenPoses, ObjectQuery
from roboprompt_client.errors import InvalidInputError


def test_poses_are_taken_as_they_come():
    queries = [ObjectQuery("lid", (0.1, 0.2, 0.7), (0.0, 0.6, 0.0, 0.8)), ObjectQuery("jar", (0.3, 0.0, 0.7))]
    lid, jar = GivenPoses().estimate(queries, [])
    assert (lid.name, jar.name) == ("lid", "jar")
    np.testing.assert_array_equal(lid.position_m, [0.1, 0.2, 0.7])
    np.testing.assert_array_equal(lid.quaternion_xyzw, [0, 0.6, 0, 0.8])
    assert jar.quaternion_xyzw is None
    assert (lid.estimator, lid.cameras) == ("given", ())


@pytest.mark.parametrize(
    ("query", "field"),
    [
        (ObjectQuery("lid", (0.1, 0.2)), "objects[lid].position"),
        (ObjectQuery("lid", (0.1, 0.2, float("nan"))), "objects[lid].position"),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 0, 2)), "objects[lid].quaternion_xyzw"),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 1)), "objects[lid].quaternion_xyzw"),
    ],
)
def test_a_broken_pose_is_refused_by_name(query, field):
    with pytest.raises(InvalidInputError) as caught:
        GivenPoses().estimate([ObjectQuery("jar", (0, 0, 1)), query], [])
    assert caught.value.field == field


@pytest.mark.parametrize("query", [ObjectQuery("lid"), ObjectQuery("lid", mask_ids=(3,))])
def test_a_missing_pose_comes_with_the_remedy(query):
    with pytest.raises(InvalidInputError, match=r"is missing .*object_models") as caught:
        GivenPoses().estimate([query], [])
    assert caught.value.field == "objects[lid].position"
