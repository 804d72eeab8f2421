"""Bounds of motion, JSON and MessagePack documents that no robot should send."""

import gzip
import json
import struct

import msgpack

from tests.attack.hostile import JSON, LIMITED, MSGPACK, Attack, limits, posted, settings
from tests.attack.payloads import QUESTION

BOX = '{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}'
TASK = f"/tasks/{LIMITED}"
GZIP = {**JSON, "content-encoding": "gzip"}
WHOLE = json.dumps(QUESTION).encode()


def asking(text, status=400, field=None):
    """A question with more members, as JSON text."""
    return sent(WHOLE[:-1] + b", " + text + b"}", status, field)


def sent(body, status=400, field=None, headers=JSON):
    """A question as these bytes."""
    return posted("/predict", body, status, field, headers)


def packed(tail, status=400, field=None, members=1):
    """A question in MessagePack with more members, as bytes that follow its own."""
    body = msgpack.packb(QUESTION)
    return posted("/predict", bytes([body[0] + members]) + body[1:] + tail, status, field, MSGPACK)


def extra(depth, status, field=None):
    """An upload with lists so deep."""
    body = b'{"metadata": {"extra": {"a": ' + b"[" * depth + b"]" * depth + b'}}, "trajectory": {}}'
    return posted("/episodes", body, status, field)


def behind_two_types(body, status):
    """Settings whose first content type is not their last."""
    types = [("content-type", "application/json"), ("content-type", "multipart/form-data")]
    return Attack("PUT", TASK, status, None, body, types)


LIMITS = {
    "step of NaN": limits('{"max_step_m": NaN}'),
    "step of minus zero": limits('{"max_step_m": -0.0}'),
    "turn just above 180": limits('{"max_step_rotation_deg": 180.00000000000003}'),
    "boxes, 10,000": limits(f'{{"keep_out": [{", ".join([BOX] * 10_000)}]}}', 413, None),
    "boxes, 65": limits(f'{{"keep_out": [{", ".join([BOX] * 65)}]}}'),
    "box with min above max": limits('{"keep_out": [{"min": [1, 1, 1], "max": [0, 0, 0]}]}'),
    "box without room on one axis": limits('{"keep_out": [{"min": [0, 0, 0], "max": [1, 1, -0.0]}]}'),
    "box of four axes": limits('{"keep_out": [{"min": [0, 0, 0, 0], "max": [1, 1, 1, 1]}]}'),
    "box with a member nobody knows": limits('{"keep_out": [{"min": [0, 0, 0], "max": [1, 1, 1], "m": 1}]}'),
    "a bound whose name has a letter in Cyrillic": limits('{"max_st\u0435p_m": 0.5}'),
    "a list of bounds": limits('[{"max_step_m": 9}]'),
    "the same bound twice, the second lax": limits('{"max_step_m": 0.1, "max_step_m": null}', 400, None),
    "workspace wider than any float": settings(
        '{"workspace": {"min": [-1e308, -1e308, -1e308], "max": [1e308, 1e308, 1e308]}}', 422, "workspace"
    ),
    "workspace turned over": settings('{"workspace": {"min": [9, 9, 9]}}', 422, "workspace"),
    "workspace of a preset and a box": settings(
        '{"workspace": {"preset": "rlbench", "min": [0, 0, 0]}}', 422, "workspace"
    ),
    "aliases that turn the direction of writing": settings('{"aliases": {"cube": ["\u202eebuc"]}}', 422, "aliases"),
    "a name of half a surrogate pair": settings(r'{"\ud800": 1}', 400),
}

BODIES = {
    "lists 40,000 deep behind two content types": behind_two_types(b"[" * 40_000 + b"]" * 40_000, 400),
    "330,000 lists behind two content types": behind_two_types(b"[" + b"[]," * 330_000 + b"[]]", 413),
    "settings after a byte order mark": settings(b'\xef\xbb\xbf{"robot_base": [NaN, 0, 0]}', 400),
    "settings that are not UTF-8": settings(b'{"system_prompt": "\xff\xfe"}', 400),
    "UTF-8 of a surrogate": asking(b'"model": "\xed\xa0\x80"'),
    "the same member twice": asking(b'"seed": 1, "seed": "x"'),
    "an integer of 4,000 digits": asking(b'"seed": ' + b"9" * 4000, 422, "seed"),
    "timeout of a nanosecond": asking(b'"timeout_s": 1e-9', 422, "timeout_s"),
    "two documents": sent(WHOLE * 2),
    "lists 60 deep in extra": extra(60, 422, "task"),
    "lists 70 deep in extra": extra(70, 400),
    "a document of one string": sent(b'"' + b"a" * 1000 + b'"'),
    "JSON that says it is MessagePack": sent(WHOLE, headers=MSGPACK),
    "MessagePack that says it is JSON": sent(msgpack.packb(QUESTION)),
    "a content type of 10 kB": sent(WHOLE, 415, headers={"content-type": "a/" + "b" * 10_000}),
    "a gzip bomb": posted("/episodes", gzip.compress(b" " * 20_000_000), 415, None, GZIP),
    "MessagePack of a list": sent(msgpack.packb([1, 2]), headers=MSGPACK),
    "MessagePack with the same key twice": packed(b"\xa4seed\x01\xa4seed\xa1x", members=2),
    "MessagePack with NaN": packed(b"\xabtemperature\xcb" + struct.pack(">d", float("nan")), 422, "temperature"),
    "MessagePack with a timestamp": packed(b"\xa4seed\xd6\xff\0\0\0\0"),
    "MessagePack with text that is not UTF-8": packed(b"\xa5model\xa2\xff\xfe"),
    "MessagePack with a text that ends early": packed(b"\xa5model\xdb\xff\xff\xff\xff"),
    "MessagePack followed by more": sent(msgpack.packb(QUESTION) + b"\0", headers=MSGPACK),
    "an outcome of a prediction that is none": Attack(
        "POST", "/predictions/%00/outcome", 404, None, b'{"success": true}', JSON
    ),
    "an outcome that is neither true nor false": posted("/predictions/x/outcome", {"success": 2}, 422, "success"),
}
