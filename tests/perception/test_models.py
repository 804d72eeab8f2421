import json
from dataclasses import asdict

import pytest

from app.perception.base import ObjectQuery
from app.perception.cuboid.model import ColorModel, CuboidModel, Rank
from app.perception.models import MODELS, MasksModel, model_from_json
from app.perception.registry import ESTIMATORS
from roboprompt_client.errors import InvalidInputError

CUBOID = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}
FULL = CuboidModel(
    (0.08, 0.09, 0.01), ColorModel((100, 140), (0.5, 1), (0.2, 0.9)), "box", (0.01, 0, 0), Rank(2, "mat", 4), "mat", 0.6
)


@pytest.mark.parametrize("model", [FULL, CuboidModel((0.1, 0.1, 0.2), ColorModel((345, 14))), MasksModel(True, 180.0)])
def test_a_model_survives_json_alone_and_in_a_query(model):
    assert model_from_json("cup", json.loads(json.dumps(model.as_json()))) == model
    query = ObjectQuery("cup", model=model)
    assert ObjectQuery.from_json(json.loads(json.dumps(asdict(query)))) == query


def test_every_model_has_an_estimator_that_reads_it():
    assert set(MODELS) <= set(ESTIMATORS)


def test_a_color_can_be_a_name():
    model = model_from_json("cube", CUBOID)
    assert model == CuboidModel((0.05, 0.05, 0.05), ColorModel((345.0, 14.0)))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"estimator": "psychic"}, "estimator"),
        ({"size_m": [0.05, 0.05]}, "size_m"),
        ({"size_m": [0.05, 0.05, 0]}, "size_m"),
        ({"size_m": [0.05, float("nan"), 1]}, "size_m"),
        ({"size_m": [0.05, 0.05, 10**400]}, "size_m"),
        ({"size_m": "big"}, "size_m"),
        ({"color": "reddish"}, "color"),
        ({"color": {"hue_deg": [350, 370]}}, "color.hue_deg"),
        ({"color": {"hue_deg": [350, 10], "saturation": [0.5, 0.2]}}, "color.saturation"),
        ({"color": {"hue_deg": [350, 10], "hew": 1}}, "color.hew"),
        ({"color": {"saturation": [0.5, 1]}}, "color.hue_deg"),
        ({"shape": "sphere"}, "shape"),
        ({"shape": "cylinder", "size_m": [0.05, 0.06, 0.1]}, "size_m"),
        ({"origin_m": [0.01, 0, 0]}, "origin_m"),
        ({"rank": {"number": 3, "nearest_to": "mat", "of": 2}}, "rank.number"),
        ({"rank": {"number": 1, "nearest_to": "}", "of": 2}}, "rank.nearest_to"),
        ({"rank": {"number": 1, "of": 2}}, "rank.nearest_to"),
        ({"away_from": "]"}, "away_from"),
        ({"min_confidence": 1.5}, "min_confidence"),
        ({"min_confidence": -(10**400)}, "min_confidence"),
        ({"weight_kg": 1}, "weight_kg"),
    ],
)
def test_a_wrong_field_is_named_with_its_object(change, field):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("red cube", {**CUBOID, **change})
    assert caught.value.field == f"object_models[red cube].{field}"
    assert caught.value.valid


def test_a_missing_field_and_a_model_that_is_none_are_named():
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("cube", {"estimator": "cuboid", "color": "red"})
    assert caught.value.field == "object_models[cube].size_m"
    for nothing in (None, [], "cuboid", {}):
        with pytest.raises(InvalidInputError) as caught:
            model_from_json("cube", nothing)
        assert caught.value.field == "object_models[cube].estimator"


def test_masks_models_are_checked():
    for change, field in (({"rotation": "yes"}, "rotation"), ({"yaw_symmetry_deg": 45}, "yaw_symmetry_deg")):
        with pytest.raises(InvalidInputError) as caught:
            model_from_json("cube", {"estimator": "masks", **change})
        assert caught.value.field == f"object_models[cube].{field}"
