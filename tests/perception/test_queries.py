"""What is asked of estimators, and which of them finds which object; poses that the caller gives."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from app.perception.base import ESTIMATOR_NAMES, GivenPoses, ObjectQuery
from app.perception.models import MODELS, MasksModel, model_from_json
from app.perception.registry import ESTIMATORS, estimate_poses
from roboprompt_client.errors import InvalidInputError
from tests.perception.solid_scene import FRONT, LEFT, cube, shoot

SOLIDS = (cube("red", 0.05, 0.1), cube("blue", -0.1, -0.05))
RED = model_from_json("red cube", {"estimator": "cuboid", "size_m": [0.05] * 3, "color": "red"})
PLACED = ObjectQuery("lid", (0.1, 0.2, 0.7), (0.0, 0.6, 0.0, 0.8), (98, 99))


@pytest.mark.parametrize("query", [ObjectQuery("lid"), ObjectQuery("lid", (0.1, 0.2, 0.7)), PLACED])
def test_a_query_survives_json(query):
    assert ObjectQuery.from_json(json.loads(json.dumps(asdict(query)))) == query


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"name": "}>[["}, "objects.name"),
        ({"name": "lid", "quaternion_xyzw": (0, 0, 0, 1)}, "objects[lid].quaternion_xyzw"),
    ],
)
def test_a_query_that_makes_no_sense_is_refused(values, field):
    with pytest.raises(InvalidInputError) as caught:
        ObjectQuery(**values)
    assert caught.value.field == field


def test_each_object_is_found_by_its_own_estimator_in_the_order_asked():
    objects = [
        ObjectQuery("plate", (1.0, 2.0, 3.0)),
        ObjectQuery("red cube", model=RED),
        ObjectQuery("blue cube", mask_ids=(2,), model=MasksModel()),
        ObjectQuery("lid", (3.0, 2.0, 1.0)),
    ]
    poses = estimate_poses("given", objects, [shoot(SOLIDS, view) for view in (FRONT, LEFT)])
    assert [pose.name for pose in poses] == [query.name for query in objects]
    assert [pose.estimator for pose in poses] == ["given", "cuboid", "masks", "given"]
    np.testing.assert_allclose(poses[1].position_m, SOLIDS[0].position_m, atol=0.003)


def test_every_kind_of_model_has_its_estimator():
    assert set(MODELS) <= set(ESTIMATORS)
    assert tuple(ESTIMATORS) == ESTIMATOR_NAMES


def test_poses_are_taken_as_they_come():
    lid, jar = GivenPoses().estimate([PLACED, ObjectQuery("jar", (0.3, 0.0, 0.7))], [])
    assert (lid.name, jar.name) == ("lid", "jar")
    np.testing.assert_array_equal(lid.position_m, [0.1, 0.2, 0.7])
    np.testing.assert_array_equal(lid.quaternion_xyzw, [0, 0.6, 0, 0.8])
    assert jar.quaternion_xyzw is None
    assert (lid.estimator, lid.cameras) == ("given", ())


@pytest.mark.parametrize(
    ("query", "field", "message"),
    [
        (ObjectQuery("lid", (0.1, 0.2)), "position", "is |has "),
        (ObjectQuery("lid", (0.1, 0.2, float("nan"))), "position", "is |has "),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 0, 2)), "quaternion_xyzw", "is |has "),
        (ObjectQuery("lid", (0.1, 0.2, 0.7), (0, 0, 1)), "quaternion_xyzw", "is |has "),
        (ObjectQuery("lid"), "position", r"is missing .*object_models"),
        (ObjectQuery("lid", mask_ids=(3,)), "position", r"is missing .*object_models"),
    ],
)
def test_a_broken_or_missing_pose_is_refused_by_name(query, field, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        GivenPoses().estimate([ObjectQuery("jar", (0, 0, 1)), query], [])
    assert caught.value.field == f"objects[lid].{field}"
