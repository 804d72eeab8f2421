from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.masks import MaskedPoints
from app.perception.models import MasksModel
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from app.pipeline.geometry import yaw_rad
from tests.perception.solid_scene import FRONT, LEFT, Solid, cube, shoot


def estimate(solids, model, views=(FRONT,)):
    query = ObjectQuery("thing", mask_ids=(1,), model=model)
    return MaskedPoints().estimate([query], [shoot(solids, view) for view in views])[0]


def yaw_deg(pose):
    return np.degrees(yaw_rad(Rotation.from_quat(pose.quaternion_xyzw)))


@pytest.mark.parametrize("views", [(FRONT,), (FRONT, LEFT)])
def test_a_cubes_yaw_is_given_in_its_quarter_turn_and_its_position_stays(views):
    solids = [cube("red", 0, 0.02, 0.5 + np.pi / 2)]
    pose = estimate(solids, MasksModel(rotation=True), views)
    assert yaw_deg(pose) == pytest.approx(np.degrees(0.5), abs=3)
    plain = estimate(solids, None, views)
    assert plain.quaternion_xyzw is None
    np.testing.assert_array_equal(pose.position_m, plain.position_m)


def test_the_longer_side_is_the_x_axis_whatever_color_it_has():
    bar = Solid("grey", (0, 0, 0.02), -1.0, (0.09, 0.05, 0.04))
    assert yaw_deg(estimate([bar], MasksModel(True, 180))) == pytest.approx(np.degrees(-1.0), abs=3)


def test_what_has_no_yaw_is_refused():
    with pytest.raises(UncertainPoseError, match="looks round"):
        estimate([Solid("red", (0, 0, 0.02), 0, (0.07, 0.07, 0.04), round=True)], MasksModel(True))
    with pytest.raises(UncertainPoseError, match="too alike for a heading"):
        estimate([cube("red", 0, 0, 0.3)], MasksModel(True, 180))


def test_an_object_with_few_masked_pixels_has_no_rotation_and_is_refused():
    frame = shoot([cube("red", 0, 0.02, 0.5)], FRONT)
    rows, columns = np.nonzero(frame.mask == 1)
    mask = np.zeros_like(frame.mask)
    mask[rows[:30], columns[:30]] = 1
    query = ObjectQuery("thing", mask_ids=(1,), model=MasksModel(rotation=True))
    with pytest.raises(ObjectNotVisibleError, match="fewer than 40 masked pixels have depth"):
        MaskedPoints().estimate([query], [replace(frame, mask=mask)])
