import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.given import GivenPoses
from app.pipeline.errors import InvalidInputError


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
        (ObjectQuery("lid"), "objects[lid].position"),
        (ObjectQuery("lid", mask_ids=(3,)), "objects[lid].position"),
        (ObjectQuery("lid", (0.1, 0.2)), "objects[lid].position"),
        (ObjectQuery("lid", (0.1, 0.2, float("nan"))), "objects[lid].position"),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 0, 2)), "objects[lid].quaternion_xyzw"),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 1)), "objects[lid].quaternion_xyzw"),
    ],
)
def test_a_missing_or_broken_pose_is_refused_by_name(query, field):
    with pytest.raises(InvalidInputError) as caught:
        GivenPoses().estimate([ObjectQuery("jar", (0, 0, 1)), query], [])
    assert caught.value.field == field
