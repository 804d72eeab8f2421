import json

import numpy as np
import pytest

from app.perception.markers.model import Marker, MarkersModel
from app.perception.models import model_from_json
from roboprompt_client.errors import InvalidInputError

SHIFTED = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.025), (0.0, 0.0, 0.0, 1.0))
DOCUMENT = {"estimator": "markers", "dictionary": "DICT_APRILTAG_36h11", "markers": [{"id": 7, "size_m": 0.03}]}


def test_a_model_survives_json():
    model = MarkersModel("DICT_4X4_50", (Marker(0, 0.04), Marker(49, 0.02, SHIFTED)), upright=True)
    assert model_from_json("red cube", json.loads(json.dumps(model.as_json()))) == model


def test_a_model_from_few_words():
    model = model_from_json("red cube", DOCUMENT)
    assert model == MarkersModel("DICT_APRILTAG_36h11", (Marker(7, 0.03, tuple(map(tuple, np.eye(4).tolist()))),))


@pytest.mark.parametrize(
    ("changes", "field", "shown"),
    [
        ({"dictionary": "DICT_5X5"}, "dictionary", "DICT_5X5"),
        ({"dictionary": ["DICT_4X4_50"]}, "dictionary", "DICT_4X4_50"),
        ({"markers": []}, "markers", "empty"),
        ({"markers": {"id": 1}}, "markers", "id"),
        ({"markers": [7]}, "markers[0]", "7"),
        ({"markers": [{"id": 7}]}, "markers[0].size_m", "missing"),
        ({"markers": [{"id": -1, "size_m": 0.1}]}, "markers[0].id", "-1"),
        ({"markers": [{"id": True, "size_m": 0.1}]}, "markers[0].id", "True"),
        ({"markers": [{"id": 587, "size_m": 0.1}]}, "markers[0].id", "587"),
        ({"markers": [{"id": 1, "size_m": 0.1}, {"id": 1, "size_m": 0.1}]}, "markers[1].id", "twice"),
        ({"markers": [{"id": 1, "size_m": 0}]}, "markers[0].size_m", "0"),
        ({"markers": [{"id": 1, "size_m": "4 cm"}]}, "markers[0].size_m", "4 cm"),
        ({"markers": [{"id": 1, "size_m": float("nan")}]}, "markers[0].size_m", "nan"),
        ({"markers": [{"id": 1, "size_m": 0.1, "color": 1}]}, "markers[0].color", "not a field"),
        ({"markers": [{"id": 1, "size_m": 0.1, "marker_to_object": [[1, 0, 0]]}]}, "markers[0].marker_to_object", "1"),
        ({"upright": "yes"}, "upright", "yes"),
        ({"min_confidence": 2}, "min_confidence", "2"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, field, shown):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("red cube", {**DOCUMENT, **changes})
    assert caught.value.field == f"object_models[red cube].{field}"
    assert shown in caught.value.message
    assert caught.value.valid


@pytest.mark.parametrize(
    "rotation",
    [np.diag([1.0, 1.0, -1.0]), np.diag([2.0, 1.0, 1.0]), np.full((3, 3), 1e300), np.zeros((3, 3))],
    ids=["mirrored", "stretched", "huge", "zero"],
)
def test_a_transform_that_is_not_rigid_is_refused(rotation):
    transform = np.eye(4)
    transform[:3, :3] = rotation
    with pytest.raises(InvalidInputError, match="not a rigid transform") as caught:
        Marker(1, 0.04, tuple(map(tuple, transform.tolist())))
    assert caught.value.field == "marker_to_object"
