"""What no robot should send, on a real service: each is refused as the table says, and nothing of it is stored."""

import json
import socket
from urllib.parse import urlsplit

import httpx
import pytest

from tests.e2e.processes import killable_server
from tests.episodes import camera, upload

PLACE_M = (0.1, 0.1, 0.78)
QUESTION = {
    "task": "pick",
    "instruction": "pick up the cube",
    "objects": [{"name": "cube", "position": [0.1, 0.1, 0.8]}],
}
WHOLE = json.dumps(QUESTION).encode()
JSON = {"content-type": "application/json"}
BOUNDS = {"keep_out": [{"min": [0.5, 0.3, 0.7], "max": [0.6, 0.4, 0.8]}], "max_step_m": 0.4}
LONG = "9" * 10_000
RAW_TIMEOUT_S = 2.0


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    """A service with a task `pick` that has one demonstration and bounds of motion."""
    settings = {"ROBOPROMPT_DEFAULT_MODEL": "nearest", "ROBOPROMPT_MAX_BODY_MB": "3"}
    server = killable_server(tmp_path_factory.mktemp("hostile"), settings)
    with server as (_, url), httpx.Client(base_url=url, timeout=60) as client:
        assert upload(client, "pick", PLACE_M).status_code == 201
        assert client.put("/tasks/pick", json={"motion_limits": BOUNDS}).status_code == 200
        yield client


def stored(http):
    """All that a request might leave: whole tasks with their settings, episodes, predictions."""
    return [http.get(address).json() for address in ("/tasks", "/episodes", "/predictions")]


def asking(members):
    """A question with more members, as JSON text: Python's values cannot say all of it."""
    return "POST /predict", WHOLE[:-1] + b", " + members + b"}"


def limits(text):
    return "PUT /tasks/pick", b'{"motion_limits": ' + text.encode() + b"}"


def extra(text):
    return "POST /episodes", b'{"metadata": {"extra": {"a": ' + text + b'}}, "trajectory": {}}'


def part(name, data, filename=b"f"):
    """A part of a form; `name` may hold what clients would not write."""
    return b'Content-Disposition: form-data; name="' + name + b'"; filename="' + filename + b'"', data


def form(*parts, boundary=b"frontier", parameters=b"", close=True):
    """A multipart question; each part is (header lines, data)."""
    pieces = [b"--" + boundary + b"\r\n" + head + b"\r\n\r\n" + data + b"\r\n" for head, data in parts]
    body = b"".join(pieces) + (b"--" + boundary + b"--\r\n" if close else b"")
    return "POST /predict", body, {"content-type": b"multipart/form-data; boundary=" + boundary + parameters}


METADATA = part(b"metadata", WHOLE)
OBJECTS = [{"name": f"cube {k}", "position": PLACE_M} for k in range(65)]
CAMERAS = [camera(f"c{k}") for k in range(17)]
BOX = '{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}'
# What is sent (method and address, body, headers), the status, and words of the answer.
TABLE = {
    "step of NaN": (limits('{"max_step_m": NaN}'), 422, "motion_limits.max_step_m"),
    "step of minus zero": (limits('{"max_step_m": -0.0}'), 422, "motion_limits.max_step_m"),
    "turn just above 180": (limits('{"max_step_rotation_deg": 180.00000000000003}'), 422, "max_step_rotation_deg"),
    "boxes, 65": (limits(f'{{"keep_out": [{", ".join([BOX] * 65)}]}}'), 422, "motion_limits.keep_out"),
    "box upside down": (limits('{"keep_out": [{"min": [1, 1, 1], "max": [0, 0, 0]}]}'), 422, "keep_out"),
    "box without room": (limits('{"keep_out": [{"min": [0, 0, 0], "max": [1, 1, -0.0]}]}'), 422, "keep_out"),
    "bound with a letter in Cyrillic": (limits('{"max_st\u0435p_m": 0.5}'), 422, "is not a known field"),
    "a list of bounds": (limits('[{"max_step_m": 9}]'), 422, "motion_limits"),
    "the same bound twice": (limits('{"max_step_m": 0.1, "max_step_m": null}'), 400, "appears twice"),
    "workspace beyond floats": (
        ("PUT /tasks/pick", b'{"workspace": {"min": [-1e308, -1e308, -1e308], "max": [1e308, 1e308, 1e308]}}'),
        422,
        "workspace",
    ),
    "half a surrogate pair": (("PUT /tasks/pick", rb'{"\ud800": 1}'), 400, "is not JSON"),
    "settings that are not UTF-8": (("PUT /tasks/pick", b'{"system_prompt": "\xff\xfe"}'), 400, "is not JSON"),
    "settings of 1.5 MB": (("PUT /tasks/pick", b" " * 1_500_000), 413, "at most 1000000 bytes"),
    "a question of 4 MB": (("POST /predict", b" " * 4_000_000), 413, "at most 3000000 bytes"),
    "the same member twice": (asking(b'"seed": 1, "seed": "x"'), 400, "'seed' appears twice"),
    "an integer of 5,000 digits": (asking(b'"seed": ' + b"9" * 5000), 400, "is not JSON"),
    "timeout of a nanosecond": (asking(b'"timeout_s": 1e-9'), 422, "timeout_s"),
    "9,000 unknown members": (
        asking(b", ".join(b'"u%d": 1' % k for k in range(9000))),
        422,
        "the first 20 of 9000 errors",
    ),
    "two documents": (("POST /predict", WHOLE * 2), 400, "is not JSON"),
    "a document of one string": (("POST /predict", b'"aaa"'), 400, "is a text, expected a JSON object"),
    "lists 100,000 deep": (asking(b'"seed": ' + b"[" * 100_000), 400, "nested too deeply"),
    "lists 900 deep in extra": (extra(b"[" * 900 + b"]" * 900), 422, "task"),
    "a content type of 10 kB": (("POST /predict", WHOLE, {"content-type": "a/" + "b" * 10_000}), 415, "content type"),
    "neither true nor false": (("POST /predictions/x/outcome", b'{"success": 2}'), 422, "success"),
    "no such prediction": (("POST /predictions/%00/outcome", b'{"success": true}'), 404, "there is no prediction"),
    "65 objects": (("POST /predict", json.dumps({**QUESTION, "objects": OBJECTS}).encode()), 422, "objects"),
    "17 cameras": (("POST /poses", json.dumps({"objects": OBJECTS[:1], "cameras": CAMERAS}).encode()), 422, "cameras"),
    "a long name of a task": (("PUT /tasks/" + "n" * 65, b"{}"), 422, "1 to 64"),
    "an image that is no base64": (
        ("POST /predict", json.dumps({**QUESTION, "rgb_c": "A=A="}).encode()),
        422,
        "rgb_c: is not base64",
    ),
    "a boundary of 10 kB": (form(METADATA, boundary=b"b" * 10_000), 400, "Invalid multipart"),
    "a boundary only": (form(), 422, "metadata: is missing"),
    "no last boundary": (form(METADATA, close=False), 422, "metadata: is missing"),
    "10,000 files": (form(*[part(b"f%d" % k, b"") for k in range(10_000)]), 400, "Too many"),
    "a part without a name": (form(METADATA, (b"Content-Disposition: form-data", b"x")), 400, "name"),
    "a part of 10,000 headers": (form(METADATA, (b"\r\n".join([b"A: b"] * 10_000), b"x")), 400, ""),
    "metadata twice": (form(METADATA, METADATA), 422, "metadata: appears twice"),
    "metadata of 1.5 MB": (form(part(b"metadata", b" " * 1_500_000)), 413, "at most 1000000 are read"),
    "a name that leads upwards": (form(METADATA, part(b"../../etc/passwd", b"x")), 422, "../../etc"),
    "a name that is not UTF-8": (form(METADATA, part(b"rgb_\xff\xfe", b"x")), 422, "rgb_"),
    "charset idna": (form(part(b"metadata", b"a" * 64), parameters=b"; charset=idna"), 415, "write the form in UTF-8"),
    "a form for settings": (("PUT /tasks/pick", *form(METADATA)[1:]), 422, "sent as application/json"),
    "cursor beyond 64 bits": ((f"GET /episodes?cursor={2**63}",), 422, "cursor"),
    "cursor of 10,000 digits": ((f"GET /episodes?cursor={LONG}",), 414, "at most 2000 characters"),
    "limit twice, the second wrong": (("GET /episodes?limit=5&limit=x",), 422, "limit"),
    "outcome of another case": (("GET /predictions?outcome=SUCCESS",), 422, "outcome"),
    "task with a null byte": (("GET /episodes?task=pick%00",), 404, "there is no task"),
    "task that is not UTF-8": (("GET /episodes?task=%ff%fe",), 404, "there is no task"),
    "id with encoded slashes": (("GET /episodes/..%2f..%2ftasks%2fpick",), 404, ""),
    "id of 30 kB": ((f"GET /predictions/{LONG * 3}",), 404, "there is no prediction"),
    "camera that leads upwards": (("GET /episodes/x/images/..%2f..%2fblobs/rgb",), 404, ""),
    "task's name that leads upwards": (("PUT /tasks/..%2fkeys", b"{}"), 404, ""),
    "task's name with a line end": (("PUT /tasks/a%0d%0ab", b"{}"), 422, "task"),
    "task's name of half a surrogate pair": (("PUT /tasks/%ED%A0%80", b"{}"), 422, "task"),
    "deletion of another spelling": (("DELETE /tasks/PICK",), 404, "there is no task"),
    "a method that the address has not": (("PATCH /tasks",), 405, "valid: GET"),
    "a stream of an unknown task": (
        ("POST /predict", WHOLE.replace(b'"pick"', b'"none"'), {**JSON, "accept": "text/event-stream"}),
        404,
        "there is no task",
    ),
}


@pytest.mark.parametrize("name", TABLE)
def test_a_hostile_request(http, name):
    (asked, *content), status, words = TABLE[name]
    method, address = asked.split(" ", 1)
    body, headers = (*content, None, None)[:2]
    before = stored(http)
    answer = http.request(method, address, content=body, headers=headers or JSON)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json"), answer.text
    said = answer.json()
    assert words in said["detail"], said
    assert len(answer.content) < 20_000
    assert stored(http) == before


def post(headers, body=b"{}"):
    """The bytes of a question with these header lines."""
    lines = ["POST /predict HTTP/1.1", "Host: 127.0.0.1", "Content-Type: application/json", *headers.split("|"), "", ""]
    return "\r\n".join(lines).encode("latin-1") + body


CHUNKED = "Transfer-Encoding: chunked"
# What is sent as it is, and the status of the answer.
RAW = {
    "a length below zero": (post("Content-Length: -1"), "400"),
    "a length of a terabyte": (post(f"Content-Length: {10**12}"), "413"),
    "two lengths": (post("Content-Length: 2|Content-Length: 3"), "400"),
    "chunks beyond the largest body": (post(CHUNKED, (b"fffff\r\n" + b" " * 0xFFFFF + b"\r\n") * 4), "413"),
    "a chunk of a size beyond 64 bits": (post(CHUNKED, b"f" * 21 + b"\r\n{}\r\n"), "400"),
    "an encoding of transfer nobody knows": (post("Transfer-Encoding: gzip"), "400"),
    "headers without end": (b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 20_000, "400"),
    "an address without end": (b"GET /" + b"a" * 100_000, "400"),
}


@pytest.mark.parametrize("name", RAW)
def test_hostile_bytes(http, name):
    sent, status = RAW[name]
    place = urlsplit(str(http.base_url))
    with socket.create_connection((place.hostname, place.port), timeout=RAW_TIMEOUT_S) as connection:
        connection.sendall(sent)
        line = connection.recv(65_536).partition(b"\r\n")[0].decode("latin-1")
    assert line.split(" ")[1] == status, line
    assert http.get("/healthz").status_code == 200
