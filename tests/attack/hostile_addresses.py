"""Addresses, queries and headers that no robot should send; and bytes that are no request."""

from tests.attack.hostile import JSON, Attack, asked, posted
from tests.attack.payloads import QUESTION

LONG = "9" * 10_000


def streamed(name, value, status, field=None):
    """A question with this value, to be answered as a stream."""
    headers = {**JSON, "accept": "a/b, text/event-stream;q=0.9"}
    return posted("/predict", {**QUESTION, name: value}, status, field, headers)


ADDRESSES = {
    "cursor beyond 64 bits": asked(f"/episodes?cursor={2**63}", 422, "cursor"),
    "cursor of 10,000 digits": asked(f"/episodes?cursor={LONG}", 414),
    "limit of minus zero": asked("/episodes?limit=-0", 422, "limit"),
    "limit twice, the second wrong": asked("/episodes?limit=5&limit=x", 422, "limit"),
    "outcome of another case": asked("/predictions?outcome=SUCCESS", 422, "outcome"),
    "task with a null byte": asked("/episodes?task=limited%00", 404),
    "task that is not UTF-8": asked("/episodes?task=%ff%fe", 404),
    "id with encoded slashes": asked("/episodes/..%2f..%2ftasks%2flimited", 404),
    "id of a null byte": asked("/episodes/%00", 404),
    "id of 30 kB": asked(f"/predictions/{LONG * 3}", 404),
    "image of a camera that leads upwards": asked("/episodes/x/images/..%2f..%2fblobs/rgb", 404),
    "image that is original in a way": asked("/episodes/x/images/c/rgb?original=maybe", 422, "original"),
    "task's name that leads upwards": Attack("PUT", "/tasks/..%2fkeys", 404, None, b"{}", JSON),
    "task's name with a line end": Attack("PUT", "/tasks/a%0d%0ab", 422, "task", b"{}", JSON),
    "task's name of half a surrogate pair": Attack("PUT", "/tasks/%ED%A0%80", 422, "task", b"{}", JSON),
    "deletion of another spelling": Attack("DELETE", "/tasks/LIMITED", 404),
    "a method that the address has not": Attack("PATCH", "/tasks", 405),
    "an Accept list of 10 kB": asked("/tasks/none", 404, None, accept=",".join(["a/b;q=0.1"] * 1000)),
    "a stream of what is not valid": streamed("timeout_s", 1e-9, 422, "timeout_s"),
    "a stream of an unknown task": streamed("task", "none", 404),
}


def post(headers, body=b"{}"):
    """The bytes of a question with these header lines."""
    lines = ["POST /predict HTTP/1.1", "Host: 127.0.0.1", "Content-Type: application/json", *headers.split("|"), "", ""]
    return "\r\n".join(lines).encode("latin-1") + body


CHUNKED = "Transfer-Encoding: chunked"
# What is sent, and how the answer's status begins; None: there is no answer, as more must come.
RAW = {
    "a method nobody knows": (b"BREW /tasks HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "400"),
    "a length below zero": (post("Content-Length: -1"), "400"),
    "a length of a terabyte": (post(f"Content-Length: {10**12}"), "413"),
    "two lengths": (post("Content-Length: 2|Content-Length: 3"), "400"),
    "a length and chunks": (post(f"Content-Length: 2|{CHUNKED}", b"0\r\n\r\n"), "400"),
    "a chunk of a size beyond 64 bits": (post(CHUNKED, b"f" * 17 + b"\r\n{}\r\n"), "400"),
    "chunks beyond a document's size": (post(CHUNKED, (b"fffff\r\n" + b" " * 0xFFFFF + b"\r\n") * 33), "413"),
    "an encoding of transfer nobody knows": (post("Transfer-Encoding: gzip"), "4"),
    "a length that is too short": (post("Content-Length: 1"), "400"),
    "chunks without end": (post(CHUNKED, b"1\r\n \r\n" * 1000), None),
    "a length that is too long": (post("Content-Length: 3"), None),
}
