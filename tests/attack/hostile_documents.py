"""Bounds of motion, JSON and MessagePack documents that no robot should send."""

import gzip
import json
import struct

import msgpack

from tests.attack.hostile import JSON, LIMITED, MSGPACK, Attack, limits, posted, settings
from tests.attack.payloads import QUESTION

BOX = '{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}'
TASK = f"/tasks/{LIMITED}"


def asking(text):
    """A question with more members, as JSON text."""
    return json.dumps(QUESTION)[:-1].encode() + b", " + text + b"}"


def packed(tail, members=1):
    """A question in MessagePack with more members, as bytes that follow its own."""
    body = msgpack.packb(QUESTION)
    return bytes([body[0] + members]) + body[1:] + tail


LIMITS = {
    "step of NaN": limits('{"max_step_m": NaN}'),
    "step of 1e309, which is infinite": limits('{"max_step_m": 1e309}'),
    "step of minus zero": limits('{"max_step_m": -0.0}'),
    "step in a string": limits('{"max_step_m": "0.5"}'),
    "step of true": limits('{"max_step_m": true}'),
    "step in a list": limits('{"max_step_m": [0.5]}'),
    "turn in a string": limits('{"max_step_rotation_deg": "NaN"}'),
    "turn of true": limits('{"max_step_rotation_deg": true}'),
    "turn just above 180": limits('{"max_step_rotation_deg": 180.00000000000003}'),
    "turn below zero by a subnormal number": limits('{"max_step_rotation_deg": -5e-324}'),
    "hand in a string": limits('{"hand_radius_m": "0"}'),
    "hand of false": limits('{"hand_radius_m": false}'),
    "hand of null": limits('{"hand_radius_m": null}'),
    "hand of minus infinity": limits('{"hand_radius_m": -Infinity}'),
    "boxes, 10,000": limits(f'{{"keep_out": [{", ".join([BOX] * 10_000)}]}}', 413, None),
    "boxes, 65": limits(f'{{"keep_out": [{", ".join([BOX] * 65)}]}}'),
    "box with min above max": limits('{"keep_out": [{"min": [1, 1, 1], "max": [0, 0, 0]}]}'),
    "box without room on one axis": limits('{"keep_out": [{"min": [0, 0, 0], "max": [1, 1, -0.0]}]}'),
    "box of strings": limits('{"keep_out": [{"min": ["0", "0", "0"], "max": ["1", "1", "1"]}]}'),
    "box of truth values": limits('{"keep_out": [{"min": [false, false, false], "max": [true, true, true]}]}'),
    "box of null": limits('{"keep_out": [null]}'),
    "box without max": limits('{"keep_out": [{"min": [0, 0, 0]}]}'),
    "box of four axes": limits('{"keep_out": [{"min": [0, 0, 0, 0], "max": [1, 1, 1, 1]}]}'),
    "box with a member nobody knows": limits('{"keep_out": [{"min": [0, 0, 0], "max": [1, 1, 1], "m": 1}]}'),
    "boxes as an object": limits('{"keep_out": {"0": ' + BOX + "}}"),
    "a bound whose name has a letter in Cyrillic": limits('{"max_st\u0435p_m": 0.5}'),
    "a bound whose name ends in a space": limits('{"max_step_m ": 0.5}'),
    "no bounds at all": limits("null"),
    "a list of bounds": limits('[{"max_step_m": 9}]'),
    "the same bound twice, the second lax": limits('{"max_step_m": 0.1, "max_step_m": null}', 400, None),
    "the same settings twice, the second lax": settings(
        '{"motion_limits": {"max_step_m": 0.1}, "motion_limits": {"max_step_m": null}}', 400
    ),
    "workspace of NaN": settings('{"workspace": {"min": [NaN, 0, 0]}}', 422, "workspace"),
    "workspace wider than any float": settings(
        '{"workspace": {"min": [-1e308, -1e308, -1e308], "max": [1e308, 1e308, 1e308]}}', 422, "workspace"
    ),
    "workspace of strings": settings('{"workspace": {"min": ["-1", "-1", "-1"]}}', 422, "workspace"),
    "workspace turned over": settings('{"workspace": {"min": [9, 9, 9]}}', 422, "workspace"),
    "workspace of a preset and a box": settings(
        '{"workspace": {"preset": "rlbench", "min": [0, 0, 0]}}', 422, "workspace"
    ),
    "robot base at 1e309": settings('{"robot_base": [1e309, 0, 0]}', 422, "robot_base"),
    "robot base in a string": settings('{"robot_base": ["0", "0", "0"]}', 422, "robot_base"),
    "aliases that turn the direction of writing": settings('{"aliases": {"cube": ["\u202eebuc"]}}', 422, "aliases"),
    "a name of half a surrogate pair": settings(r'{"\ud800": 1}'),
}

BODIES = {
    "lists 40,000 deep behind two content types": Attack(
        "PUT",
        TASK,
        400,
        None,
        b"[" * 40_000 + b"]" * 40_000,
        [("content-type", "application/json"), ("content-type", "multipart/form-data")],
    ),
    "330,000 lists behind two content types": Attack(
        "PUT",
        TASK,
        413,
        None,
        b"[" + b"[]," * 330_000 + b"[]]",
        [("content-type", "application/json"), ("content-type", "multipart/form-data")],
    ),
    "settings after a byte order mark": settings(b'\xef\xbb\xbf{"robot_base": [NaN, 0, 0]}', 422, "robot_base"),
    "question after a byte order mark": posted("/predict", b"\xef\xbb\xbf" + json.dumps(QUESTION).encode(), 400),
    "settings that are not UTF-8": settings(b'{"system_prompt": "\xff\xfe"}', 400),
    "question that is not UTF-8": posted("/predict", asking(b'"model": "\xc3\x28"'), 400),
    "UTF-8 of a surrogate": posted("/predict", asking(b'"model": "\xed\xa0\x80"'), 400),
    "overlong UTF-8": posted("/predict", asking(b'"model": "\xc0\xaf"'), 400),
    "the same member twice": posted("/predict", asking(b'"seed": 1, "seed": "x"'), 400),
    "an integer of 4,000 digits": posted("/predict", asking(b'"seed": ' + b"9" * 4000), 422, "seed"),
    "a float of 1,000 digits": posted(
        "/predict", asking(b'"temperature": 2.' + b"0" * 999 + b"1e1"), 422, "temperature"
    ),
    "an exponent of 300 digits": posted("/predict", asking(b'"temperature": 1e' + b"9" * 300), 422, "temperature"),
    "timeout of a nanosecond": posted("/predict", asking(b'"timeout_s": 1e-9'), 422, "timeout_s"),
    "timeout of thirty years": posted("/predict", asking(b'"timeout_s": 1e9'), 422, "timeout_s"),
    "timeout of NaN": posted("/predict", asking(b'"timeout_s": NaN'), 422, "timeout_s"),
    "actions of minus zero": posted("/predict", asking(b'"max_actions": -0.0'), 422, "max_actions"),
    "a comment": posted("/predict", b"/* */" + json.dumps(QUESTION).encode(), 400),
    "two documents": posted("/predict", json.dumps(QUESTION).encode() * 2, 400),
    "a comma too many": posted("/predict", json.dumps(QUESTION)[:-1].encode() + b",}", 400),
    "lists 60 deep in extra": posted(
        "/episodes",
        b'{"metadata": {"extra": {"a": ' + b"[" * 60 + b"]" * 60 + b'}}, "trajectory": {}}',
        422,
        "task",
    ),
    "lists 70 deep in extra": posted(
        "/episodes", b'{"metadata": {"extra": {"a": ' + b"[" * 70 + b"]" * 70 + b"}}}", 400
    ),
    "a document of one string": posted("/predict", b'"' + b"a" * 1000 + b'"', 400),
    "no document": posted("/predict", b"", 400),
    "JSON that says it is MessagePack": posted("/predict", json.dumps(QUESTION).encode(), 400, None, MSGPACK),
    "MessagePack that says it is JSON": posted("/predict", msgpack.packb(QUESTION), 400),
    "JSON that says it is text": posted("/predict", QUESTION, 415, None, {"content-type": "text/plain"}),
    "JSON that does not say what it is": posted("/predict", QUESTION, 415, None, {}),
    "a content type of 10 kB": posted("/predict", QUESTION, 415, None, {"content-type": "a/" + "b" * 10_000}),
    "JSON in gzip": posted(
        "/predict", gzip.compress(json.dumps(QUESTION).encode()), 400, None, {**JSON, "content-encoding": "gzip"}
    ),
    "a gzip bomb": posted(
        "/episodes", gzip.compress(b" " * 20_000_000), 400, None, {**JSON, "content-encoding": "gzip"}
    ),
    "MessagePack with the same key twice": posted(
        "/predict", packed(b"\xa4seed\x01\xa4seed\xa1x", 2), 400, None, MSGPACK
    ),
    "MessagePack with NaN": posted(
        "/predict", packed(b"\xabtemperature\xcb" + struct.pack(">d", float("nan"))), 422, "temperature", MSGPACK
    ),
    "MessagePack with a timestamp": posted("/predict", packed(b"\xa4seed\xd6\xff\0\0\0\0"), 400, None, MSGPACK),
    "MessagePack with text that is not UTF-8": posted("/predict", packed(b"\xa5model\xa2\xff\xfe"), 400, None, MSGPACK),
    "MessagePack with a text that ends early": posted(
        "/predict", packed(b"\xa5model\xdb\xff\xff\xff\xff"), 400, None, MSGPACK
    ),
    "MessagePack with bytes for text": posted("/predict", packed(b"\xa5model\xc4\x01a"), 422, "model", MSGPACK),
    "MessagePack with an integer of 64 bits": posted(
        "/predict", packed(b"\xa4seed\xcf" + b"\xff" * 8), 422, "seed", MSGPACK
    ),
    "MessagePack with a reserved byte": posted("/predict", packed(b"\xa4seed\xc1"), 400, None, MSGPACK),
    "MessagePack followed by more": posted("/predict", msgpack.packb(QUESTION) + b"\0", 400, None, MSGPACK),
    "MessagePack array of a negative shape": posted(
        "/predict",
        msgpack.packb({**QUESTION, "rgb_c": {"__ndarray__": True, "dtype": "|u1", "shape": [-1, 4, 3], "data": b""}}),
        422,
        "rgb_c",
        MSGPACK,
    ),
    "MessagePack array of a shape beyond 64 bits": posted(
        "/predict",
        msgpack.packb(
            {**QUESTION, "rgb_c": {"__ndarray__": True, "dtype": "|u1", "shape": [2**63, 2**63, 3], "data": b""}}
        ),
        422,
        "rgb_c",
        MSGPACK,
    ),
    "MessagePack array of objects": posted(
        "/predict",
        msgpack.packb({**QUESTION, "rgb_c": {"__ndarray__": True, "dtype": "O", "shape": [1], "data": b"\0" * 8}}),
        422,
        "rgb_c",
        MSGPACK,
    ),
    "an outcome of a prediction that is none": Attack(
        "POST", "/predictions/%00/outcome", 404, None, b'{"success": true}', JSON
    ),
    "an outcome that is neither true nor false": posted("/predictions/x/outcome", {"success": 2}, 422, "success"),
}
