from dataclasses import replace

import numpy as np
import pytest

from app.perception.markers.estimator import confidence, depth_contradiction
from app.perception.markers.fit import MarkerFit
from app.perception.markers.model import Marker
from app.perception.markers.view import MarkerView, SeenMarker
from roboprompt_client.camera import Camera

CAMERA = Camera("front", 600, 600, 320, 240, np.eye(4))
GOOD = MarkerFit(np.eye(4), 5.0, 0.1, 0.001, np.radians(1))


def view(depth_m):
    """A marker of 4 cm that faces the camera, 24 px wide: 1 m away by its size."""
    corners_px = np.array([[308.0, 228], [332, 228], [332, 252], [308, 252]])
    return MarkerView(Marker(3, 0.04), SeenMarker(3, corners_px, 0.1), np.full((20, 3), depth_m))


def test_a_good_fit_is_trusted():
    assert confidence(CAMERA, GOOD, [view(1.0)]) == (1.0, "")


@pytest.mark.parametrize(
    ("changes", "depth_m", "expected", "said"),
    [
        ({"corner_rms_px": 1.75}, 1.0, 0.5, "1.8 px off"),
        ({"corner_rms_px": 9.0}, 1.0, 0.0, "9.0 px off"),
        ({"position_sigma_m": 0.0125}, 1.0, 0.5, "1.2 cm"),
        ({"rotation_sigma_rad": np.radians(7.5)}, 1.0, 0.5, "degrees"),
        ({"rival_cost": 5.0}, 1.0, 0.0, "two tilts"),
        ({"rival_cost": 9.0}, 1.0, np.tanh(1), "two tilts"),
        ({"rival_cost": 50.0}, 1.0, 1.0, ""),
        ({}, 1.1, 0.5, "+10 %"),
        ({"corner_rms_px": 1.0}, 0.9, 0.5, "-10 %"),
    ],
)
def test_the_worst_doubt_counts(changes, depth_m, expected, said):
    certain, reason = confidence(CAMERA, replace(GOOD, **changes), [view(1.0), view(depth_m)])
    assert certain == pytest.approx(expected, abs=0.01)
    assert said in reason


def test_depth_that_cannot_be_is_told_from_depth_that_can():
    assert depth_contradiction(CAMERA, view(1.1)) == ""
    for depth_m in (0.001, 0.8, 1.2, 1000):
        said = depth_contradiction(CAMERA, view(depth_m))
        assert f"{depth_m:.3g} m" in said
        assert "depth_scale" in said
