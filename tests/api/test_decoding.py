"""JSON bodies are read strictly: each key once in its object, numbers that are numbers."""

import json

import pytest
from starlette.exceptions import HTTPException

from app.api.decoding import json_object


@pytest.mark.parametrize(
    "body", [b'{"a": 1, "a": 1}', b'{"b": [{"c": {"a": 1, "b": 2, "a": 3}}]}', b'{"a": 1, "\\u0061": 2}']
)
def test_a_key_that_comes_twice_is_named(body):
    with pytest.raises(HTTPException, match="'a' appears twice") as refused:
        json_object(body)
    assert refused.value.status_code == 400


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"-Infinity"])
def test_numbers_that_json_has_not_are_refused(number):
    with pytest.raises(HTTPException, match="is no JSON number"):
        json_object(b'{"a": [' + number + b"]}")


def test_bodies_without_repeated_keys_are_read():
    body = {"a": {"a": [{"a": 1}, {"a": 2}]}, "A": None}
    assert json_object(json.dumps(body).encode()) == body
