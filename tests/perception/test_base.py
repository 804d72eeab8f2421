import json
from dataclasses import asdict

import pytest

from app.perception.base import ESTIMATOR_NAMES, GivenPoses, ObjectQuery
from app.perception.masks import MaskedPoints
from app.perception.registry import ESTIMATORS
from roboprompt_client.errors import InvalidInputError


@pytest.mark.parametrize(
    "query",
    [
        ObjectQuery("lid"),
        ObjectQuery("lid", (0.1, 0.2, 0.7)),
        ObjectQuery("lid", (0.1, 0.2, 0.7), (0.0, 0.6, 0.0, 0.8), (98, 99)),
    ],
)
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


def test_estimators_by_name():
    assert isinstance(ESTIMATORS["given"], GivenPoses)
    assert isinstance(ESTIMATORS["masks"], MaskedPoints)
    assert tuple(ESTIMATORS) == ESTIMATOR_NAMES
