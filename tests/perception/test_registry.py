"""Which estimator finds which object."""

import numpy as np

from app.perception.base import ESTIMATOR_NAMES, ObjectQuery
from app.perception.models import MODELS, MasksModel, model_from_json
from app.perception.registry import ESTIMATORS, estimate_poses
from tests.perception.solid_scene import FRONT, LEFT, cube, shoot

SOLIDS = (cube("red", 0.05, 0.1), cube("blue", -0.1, -0.05))
RED = model_from_json("red cube", {"estimator": "cuboid", "size_m": [0.05] * 3, "color": "red"})


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
