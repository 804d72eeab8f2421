"""No connection keeps memory or a socket for a request that never comes."""

import socket
import time
from urllib.parse import urlsplit

import httpx
import pytest

from app.api.bounded_protocol import HEAD_TIMEOUT_S, MAX_HEAD_BYTES

START = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"


def connect(url):
    place = urlsplit(url)
    return socket.create_connection((place.hostname, place.port), timeout=HEAD_TIMEOUT_S + 10)


def answer_to(url, *pieces):
    """What comes back until the service closes the connection."""
    with connect(url) as connection:
        try:
            for piece in pieces:
                connection.sendall(piece)
            received = b""
            while chunk := connection.recv(4096):
                received += chunk
        except ConnectionError:
            return b"closed"
    return received


@pytest.mark.parametrize(
    "pieces",
    [
        [b"x-%d: %s\r\n" % (k, b"a" * 1000) for k in range(500)],
        [b"x: ", *[b"a" * 1000] * 500],
    ],
)
def test_headers_without_end(url, pieces):
    said = answer_to(url, START, *pieces)
    assert said == b"closed" or (b" 400 " in said and b"longer than 65536 bytes" in said)


def test_an_address_without_end(url):
    said = answer_to(url, b"GET /", *[b"a" * 1000] * 500)
    assert said == b"closed" or b" 400 " in said


def test_a_head_that_never_ends(url):
    begun = time.monotonic()
    silent, slow = connect(url), connect(url)
    slow.sendall(START)
    assert (silent.recv(100), slow.recv(100)) == (b"", b"")
    assert HEAD_TIMEOUT_S - 1 < time.monotonic() - begun < HEAD_TIMEOUT_S + 8
    silent.close()
    slow.close()


def test_long_bodies_and_headers_within_bounds_pass(url):
    with httpx.Client(base_url=url) as http:
        assert http.get("/healthz", headers={"x-long": "a" * (MAX_HEAD_BYTES - 2000)}).status_code == 200
        assert (
            http.post("/predict", content=b"x" * 1_000_000, headers={"content-type": "application/json"}).status_code
            == 400
        )
        assert http.get("/healthz").status_code == 200
