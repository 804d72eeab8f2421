"""A key that stands twice in one object is refused; the same key in two objects is not."""

import json

import msgpack
import pytest
from starlette.exceptions import HTTPException

from app.api.decoding import json_object, msgpack_object


@pytest.mark.parametrize(
    ("read", "body"),
    [
        (json_object, b'{"a": 1, "a": 1}'),
        (json_object, b'{"b": [{"c": {"a": 1, "b": 2, "a": 3}}]}'),
        (json_object, b'{"a": 1, "\\u0061": 2}'),
        (msgpack_object, b"\x82\xa1a\x01\xa1a\x01"),
        (msgpack_object, b"\x81\xa1b\x91\x82\xa1a\x01\xa1a\x02"),
    ],
)
def test_a_key_that_comes_twice_is_named(read, body):
    with pytest.raises(HTTPException, match="'a' appears twice") as refused:
        read(body)
    assert refused.value.status_code == 400


def test_bodies_without_repeated_keys_are_read():
    body = {"a": {"a": [{"a": 1}, {"a": 2}]}, "A": None}
    assert json_object(json.dumps(body).encode()) == msgpack_object(msgpack.packb(body)) == body
