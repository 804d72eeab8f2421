"""A key that stands twice in one object is refused; the same key in two objects is not."""

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


def test_bodies_without_repeated_keys_are_read():
    body = {"a": {"a": [{"a": 1}, {"a": 2}]}, "A": None}
    assert json_object(json.dumps(body).encode()) == body
