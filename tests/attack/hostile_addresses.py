"""Addresses, queries and headers that no robot should send; and bytes that are no request."""

from tests.attack.hostile import JSON, LIMITED, Attack, asked, posted
from tests.attack.payloads import QUESTION

LONG = "9" * 10_000
HOST = "Host: 127.0.0.1\r\n"
ADDRESSES = {
    "cursor beyond 64 bits": asked(f"/episodes?cursor={2**63}", 422, "cursor"),
    "cursor of 10,000 digits": asked(f"/episodes?cursor={LONG}", 414),
    "cursor below zero": asked("/predictions?cursor=-1", 422, "cursor"),
    "cursor of NaN": asked("/jobs?cursor=NaN", 422, "cursor"),
    "cursor with an injection": asked("/episodes?cursor=1%20OR%201=1", 422, "cursor"),
    "limit of minus zero": asked("/episodes?limit=-0", 422, "limit"),
    "limit with an exponent": asked("/episodes?limit=1e2", 422, "limit"),
    "limit in hexadecimal": asked("/predictions?limit=0x10", 422, "limit"),
    "limit twice, the second wrong": asked("/episodes?limit=5&limit=x", 422, "limit"),
    "limit that ends in a null byte": asked("/episodes?limit=5%00", 422, "limit"),
    "outcome of another case": asked("/predictions?outcome=SUCCESS", 422, "outcome"),
    "task of 10 kB": asked(f"/episodes?task={LONG}", 414),
    "task with a null byte": asked("/episodes?task=limited%00", 404),
    "task that is not UTF-8": asked("/episodes?task=%ff%fe", 404),
    "task with an injection": asked("/episodes?task=limited'%20OR%20'1'='1", 404),
    "model of 10 kB": asked(f"/tasks/pick/check?model={LONG}", 414),
    "id with encoded slashes": asked("/episodes/..%2f..%2ftasks%2flimited", 404),
    "id with twice encoded slashes": asked("/episodes/..%252f..%252ftasks", 404),
    "id of a null byte": asked("/episodes/%00", 404),
    "id of 30 kB": asked(f"/predictions/{LONG * 3}", 404),
    "image of a camera that leads upwards": asked("/episodes/x/images/..%2f..%2fblobs/rgb", 404),
    "image of an unknown kind": asked("/episodes/x/images/c/..", 404),
    "image that is original in a way": asked("/episodes/x/images/c/rgb?original=maybe", 422, "original"),
    "upload of a null byte": asked("/uploads/%00", 404),
    "task's name that leads upwards": Attack("PUT", "/tasks/..%2fkeys", 404, None, b"{}", JSON),
    "task's name with a line end": Attack("PUT", "/tasks/a%0d%0ab", 422, "task", b"{}", JSON),
    "task's name in Cyrillic": Attack("PUT", "/tasks/%D1%80ick", 422, "task", b"{}", JSON),
    "task's name of half a surrogate pair": Attack("PUT", "/tasks/%ED%A0%80", 422, "task", b"{}", JSON),
    "deletion of another spelling": Attack("DELETE", "/tasks/LIMITED", 404),
    "deletion with a null byte": Attack("DELETE", f"/tasks/{LIMITED}%00", 404),
    "a method that the address has not": Attack("PATCH", "/tasks", 405),
    "idempotency key of 10 kB": posted("/predict", QUESTION, 422, "idempotency-key", {**JSON, "idempotency-key": LONG}),
    "an Accept list of 10 kB": asked("/tasks/none", 404, None, accept=",".join(["a/b;q=0.1"] * 1000)),
    "a stream of what is not valid": posted(
        "/predict", {**QUESTION, "timeout_s": 1e-9}, 422, "timeout_s", {**JSON, "accept": "text/event-stream, */*"}
    ),
    "a stream of an unknown task": posted(
        "/predict", {**QUESTION, "task": "none"}, 404, None, {**JSON, "accept": "a/b, text/event-stream;q=0.9"}
    ),
}


def request(line, headers="", body=b""):
    """Bytes as they are sent."""
    return f"{line}\r\n{HOST}{headers}\r\n".encode("latin-1") + body


POST = "POST /predict HTTP/1.1"
TYPE = "Content-Type: application/json\r\n"
# What is sent, and how the answer's status begins; None: there is no answer, as more must come.
RAW = {
    "a method nobody knows": (request("BREW /tasks HTTP/1.1"), "400"),
    "a key with a control character": (
        request(POST, f"{TYPE}Idempotency-Key: a\x01b\r\nContent-Length: 2\r\n", b"{}"),
        "4",
    ),
    "a key with a null byte": (request(POST, f"{TYPE}Idempotency-Key: a\0b\r\nContent-Length: 2\r\n", b"{}"), "400"),
    "a key twice": (
        request(POST, f"{TYPE}Idempotency-Key: a\r\nIdempotency-Key: b\r\nContent-Length: 2\r\n", b"{}"),
        "422",
    ),
    "a length below zero": (request(POST, f"{TYPE}Content-Length: -1\r\n", b"{}"), "400"),
    "a length with a sign": (request(POST, f"{TYPE}Content-Length: +2\r\n", b"{}"), "400"),
    "a length of 30 digits": (request(POST, f"{TYPE}Content-Length: {'9' * 30}\r\n", b"{}"), "400"),
    "a length of a terabyte": (request(POST, f"{TYPE}Content-Length: {10**12}\r\n", b"{}"), "413"),
    "two lengths": (request(POST, f"{TYPE}Content-Length: 2\r\nContent-Length: 3\r\n", b"{}"), "400"),
    "a length and chunks": (
        request(POST, f"{TYPE}Content-Length: 2\r\nTransfer-Encoding: chunked\r\n", b"0\r\n\r\n"),
        "400",
    ),
    "a chunk of a size that is none": (request(POST, f"{TYPE}Transfer-Encoding: chunked\r\n", b"zz\r\n{}\r\n"), "400"),
    "a chunk of a size beyond 64 bits": (
        request(POST, f"{TYPE}Transfer-Encoding: chunked\r\n", b"f" * 17 + b"\r\n{}\r\n"),
        "400",
    ),
    "chunks beyond a document's size": (
        request(POST, f"{TYPE}Transfer-Encoding: chunked\r\n", (b"fffff\r\n" + b" " * 0xFFFFF + b"\r\n") * 33),
        "413",
    ),
    "an encoding of transfer nobody knows": (request(POST, f"{TYPE}Transfer-Encoding: gzip\r\n", b"{}"), "4"),
    "a length that is too short": (request(POST, f"{TYPE}Content-Length: 1\r\n", b"{}"), "400"),
    "chunks without end": (request(POST, f"{TYPE}Transfer-Encoding: chunked\r\n", b"1\r\n \r\n" * 1000), None),
    "a length that is too long": (request(POST, f"{TYPE}Content-Length: 3\r\n", b"{}"), None),
}
