import json

import pytest

from app.perception.models import RemoteModel, model_from_json
from roboprompt_client.errors import InvalidInputError

URL = "http://127.0.0.1:8000/poses"


def test_a_model_survives_json():
    model = RemoteModel(URL, 2.5, {"mesh": "mug.obj", "scales": [1, {"z": None}]}, 0.3)
    assert model_from_json("mug", json.loads(json.dumps(model.as_json()))) == model


@pytest.mark.parametrize(
    ("changes", "field", "shown"),
    [
        ({"url": ""}, "url", "''"),
        ({"url": None}, "url", "None"),
        ({"url": "gpu-box/poses"}, "url", "gpu-box"),
        ({"url": "ftp://gpu-box/poses"}, "url", "ftp"),
        ({"url": "http://gpu-box:port/poses"}, "url", "port"),
        ({"url": "http://me:secret@gpu-box/poses"}, "url", "password"),
        ({"timeout_s": 0}, "timeout_s", "0"),
        ({"timeout_s": 301}, "timeout_s", "301"),
        ({"timeout_s": "fast"}, "timeout_s", "fast"),
        ({"model": "mug.obj"}, "model", "mug.obj"),
        ({"min_confidence": -0.1}, "min_confidence", "-0.1"),
        ({"mesh": "mug.obj"}, "mesh", "not a field"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, field, shown):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("mug", {"estimator": "remote", "url": URL, **changes})
    assert caught.value.field == f"object_models[mug].{field}"
    assert shown in caught.value.message
    assert "secret" not in str(caught.value)
