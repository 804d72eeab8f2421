"""A key that stands twice in one object is refused; the same key in two objects is not."""

import json

import msgpack
import pytest
from starlette.exceptions import HTTPException

from app.api.decoding import json_object, msgpack_object


def is_object(value):
    """Whether it stands for an object, which may name a member twice."""
    return isinstance(value, list) and isinstance(value[0], tuple)


def json_map(value):
    if is_object(value):
        return b"{" + b",".join(json.dumps(key).encode() + b":" + json_map(item) for key, item in value) + b"}"
    if isinstance(value, list):
        return b"[" + b",".join(map(json_map, value)) + b"]"
    return json.dumps(value).encode()


def packed_map(value):
    packer = msgpack.Packer()
    if is_object(value):
        return packer.pack_map_header(len(value)) + b"".join(msgpack.packb(k) + packed_map(v) for k, v in value)
    if isinstance(value, list):
        return packer.pack_array_header(len(value)) + b"".join(map(packed_map, value))
    return msgpack.packb(value)


@pytest.mark.parametrize(
    "body", [b'{"a": 1, "a": 1}', b'{"b": [{"c": {"a": 1, "b": 2, "a": 3}}]}', b'{"a": 1, "\\u0061": 2}']
)
def test_a_key_that_comes_twice_is_named(body):
    with pytest.raises(HTTPException, match="'a' appears twice") as refused:
        json_object(body)
    assert refused.value.status_code == 400


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("where", ["seed", "objects", "position"])
def test_json_and_messagepack_are_held_to_it(packed, where):
    place = [("name", "cube"), ("position", [0, 0, 1])] + [("position", [0, 0, 2])] * (where == "position")
    pairs = [("task", "press"), ("objects", [place]), ("seed", 1)]
    pairs += [(name, value) for name, value in pairs if name == where]
    read, data = (msgpack_object, packed_map(pairs)) if packed else (json_object, json_map(pairs))
    with pytest.raises(HTTPException) as refused:
        read(data)
    assert (refused.value.status_code, f"'{where}' appears twice" in refused.value.detail) == (400, True)


def test_other_bodies_are_read_as_ever():
    body = {"a": {"a": [{"a": 1}, {"a": 2}]}, "A": None}
    assert json_object(json.dumps(body).encode()) == body
