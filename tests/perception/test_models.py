"""Object models of every kind: from JSON and back, and what is refused."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.cuboid.model import ColorModel, CuboidModel, Rank
from app.perception.markers.model import Marker, MarkersModel
from app.perception.models import MasksModel, RemoteModel, model_from_json
from app.perception.registered.model import RegisteredModel
from roboprompt_client.errors import InvalidInputError

CUBOID = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}
MARKERS = {"estimator": "markers", "dictionary": "DICT_APRILTAG_36h11", "markers": [{"id": 7, "size_m": 0.03}]}
REMOTE = {"estimator": "remote", "url": "http://127.0.0.1:8000/poses"}
REGISTERED = {"estimator": "registered", "template": "0" * 64}
SHIFTED = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.025), (0.0, 0.0, 0.0, 1.0))
RANK = Rank(2, "mat", 4)
MODELS = (
    CuboidModel(
        (0.08, 0.09, 0.01),
        ColorModel((100, 140), (0.5, 1), (0.2, 0.9)),
        origin_m=(0.01, 0, 0),
        rank=RANK,
        away_from="mat",
    ),
    CuboidModel((0.1, 0.1, 0.2), ColorModel((345, 14))),
    MasksModel(True, 180.0),
    MarkersModel("DICT_4X4_50", (Marker(0, 0.04), Marker(49, 0.02, SHIFTED)), upright=True),
    RemoteModel(REMOTE["url"], 2.5, {"mesh": "mug.obj", "scales": [1, {"z": None}]}, 0.3),
    RegisteredModel("ab" * 32, 180.0, views=("x", "y"), scores=(0.9,)),
)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.estimator)
def test_a_model_survives_json_alone_and_in_a_query(model):
    assert model_from_json("cup", json.loads(json.dumps(model.as_json()))) == model
    query = ObjectQuery("cup", model=model)
    assert ObjectQuery.from_json(json.loads(json.dumps(asdict(query)))) == query


def test_models_from_few_words():
    assert model_from_json("cube", CUBOID) == CuboidModel((0.05, 0.05, 0.05), ColorModel((345.0, 14.0)))
    marker = Marker(7, 0.03, tuple(map(tuple, np.eye(4).tolist())))
    assert model_from_json("cube", MARKERS) == MarkersModel("DICT_APRILTAG_36h11", (marker,))


def marker(**fields):
    return {"markers": [{"id": 7, "size_m": 0.1, **fields}]}


@pytest.mark.parametrize(
    ("document", "change", "field", "shown"),
    [
        (CUBOID, {"estimator": "psychic"}, "estimator", "psychic"),
        (CUBOID, {"size_m": [0.05, 0.05]}, "size_m", "0.05"),
        (CUBOID, {"size_m": [0.05, 0.05, 0]}, "size_m", "0"),
        (CUBOID, {"size_m": [0.05, float("nan"), 1]}, "size_m", "nan"),
        (CUBOID, {"size_m": [0.05, 0.05, 10**400]}, "size_m", "1000"),
        (CUBOID, {"size_m": "big"}, "size_m", "big"),
        (CUBOID, {"color": "reddish"}, "color", "reddish"),
        (CUBOID, {"color": {"hue_deg": [350, 370]}}, "color.hue_deg", "370"),
        (CUBOID, {"color": {"hue_deg": [350, 10], "saturation": [0.5, 0.2]}}, "color.saturation", "[0.5, 0.2]"),
        (CUBOID, {"color": {"hue_deg": [350, 10], "hew": 1}}, "color.hew", "not a field"),
        (CUBOID, {"color": {"saturation": [0.5, 1]}}, "color.hue_deg", "missing"),
        (CUBOID, {"shape": "sphere"}, "shape", "sphere"),
        (CUBOID, {"shape": "cylinder", "size_m": [0.05, 0.06, 0.1]}, "size_m", "0.06"),
        (CUBOID, {"origin_m": [0.01, 0, 0]}, "origin_m", "0.01"),
        (CUBOID, {"rank": {"number": 3, "nearest_to": "mat", "of": 2}}, "rank.number", "3"),
        (CUBOID, {"rank": {"number": 1, "nearest_to": "}", "of": 2}}, "rank.nearest_to", "}"),
        (CUBOID, {"rank": {"number": 1, "of": 2}}, "rank.nearest_to", "missing"),
        (CUBOID, {"away_from": "]"}, "away_from", "]"),
        (CUBOID, {"min_confidence": 1.5}, "min_confidence", "1.5"),
        (CUBOID, {"min_confidence": -(10**400)}, "min_confidence", "-1000"),
        (CUBOID, {"weight_kg": 1}, "weight_kg", "not a field"),
        ({"estimator": "cuboid"}, {"color": "red"}, "size_m", "missing"),
        ({"estimator": "masks"}, {"rotation": "yes"}, "rotation", "yes"),
        ({"estimator": "masks"}, {"yaw_symmetry_deg": 45}, "yaw_symmetry_deg", "45"),
        (MARKERS, {"dictionary": "DICT_5X5"}, "dictionary", "DICT_5X5"),
        (MARKERS, {"dictionary": ["DICT_4X4_50"]}, "dictionary", "DICT_4X4_50"),
        (MARKERS, {"markers": []}, "markers", "empty"),
        (MARKERS, {"markers": {"id": 1}}, "markers", "id"),
        (MARKERS, {"markers": [7]}, "markers[0]", "7"),
        (MARKERS, {"markers": [{"id": 7}]}, "markers[0].size_m", "missing"),
        (MARKERS, {"markers": [{"id": 1, "size_m": 0.1}, {"id": 1, "size_m": 0.1}]}, "markers[1].id", "twice"),
        (MARKERS, marker(id=-1), "markers[0].id", "-1"),
        (MARKERS, marker(id=True), "markers[0].id", "True"),
        (MARKERS, marker(id=587), "markers[0].id", "587"),
        (MARKERS, marker(size_m=0), "markers[0].size_m", "0"),
        (MARKERS, marker(size_m="4 cm"), "markers[0].size_m", "4 cm"),
        (MARKERS, marker(size_m=float("nan")), "markers[0].size_m", "nan"),
        (MARKERS, marker(color=1), "markers[0].color", "not a field"),
        (MARKERS, marker(marker_to_object=[[1, 0, 0]]), "markers[0].marker_to_object", "1"),
        (MARKERS, {"upright": "yes"}, "upright", "yes"),
        (MARKERS, {"min_confidence": 2}, "min_confidence", "2"),
        (REMOTE, {"url": ""}, "url", "''"),
        (REMOTE, {"url": None}, "url", "None"),
        (REMOTE, {"url": "gpu-box/poses"}, "url", "gpu-box"),
        (REMOTE, {"url": "ftp://gpu-box/poses"}, "url", "ftp"),
        (REMOTE, {"url": "http://gpu-box:port/poses"}, "url", "port"),
        (REMOTE, {"url": "http://me:secret@gpu-box/poses"}, "url", "password"),
        (REMOTE, {"timeout_s": 0}, "timeout_s", "0"),
        (REMOTE, {"timeout_s": 301}, "timeout_s", "301"),
        (REMOTE, {"timeout_s": "fast"}, "timeout_s", "fast"),
        (REMOTE, {"model": "mug.obj"}, "model", "mug.obj"),
        (REMOTE, {"min_confidence": -0.1}, "min_confidence", "-0.1"),
        (REMOTE, {"mesh": "mug.obj"}, "mesh", "not a field"),
        (REGISTERED, {"symmetric": 77}, "symmetric", "77"),
        (REGISTERED, {"symmetric": "round"}, "symmetric", "round"),
        (REGISTERED, {"template": "abc"}, "template", "abc"),
        (REGISTERED, {"yaw_may_be_unknown": 1}, "yaw_may_be_unknown", "1"),
    ],
)
def test_a_wrong_field_is_named_with_its_object_and_value(document, change, field, shown):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("red cube", {**document, **change})
    assert caught.value.field == f"object_models[red cube].{field}"
    assert shown in caught.value.message
    assert "secret" not in str(caught.value)
    if field != "url" or "secret" not in str(change):
        assert caught.value.valid


@pytest.mark.parametrize("nothing", [None, [], "cuboid", {}])
def test_what_is_no_model_lacks_its_estimator(nothing):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("cube", nothing)
    assert caught.value.field == "object_models[cube].estimator"


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
