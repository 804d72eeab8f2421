"""How a hostile request is written down: what is sent, and what must come back."""

import dataclasses
import json
import socket
from urllib.parse import urlsplit

JSON = {"content-type": "application/json"}
MSGPACK = {"content-type": "application/msgpack"}
BOUNDARY = "frontier"
RAW_TIMEOUT_S = 2.0
LIMITED = "limited"  # a task with bounds of motion that no row may change


@dataclasses.dataclass(frozen=True)
class Attack:
    """A request.

    Attributes:
        status: of the answer.
        field: that the answer must name; its errors name it or something within it. None: there is none to name.
    """

    method: str
    path: str
    status: int
    field: str | None = None
    body: bytes | None = None
    headers: dict = dataclasses.field(default_factory=dict)

    def sent(self, http):
        """The answer."""
        return http.request(self.method, self.path, content=self.body, headers=self.headers)


def limits(text, status=422, field="motion_limits"):
    """A change of the bounds of motion, as JSON text: Python's values cannot say all of it."""
    return settings(f'{{"motion_limits": {text}}}', status, field)


def settings(text, status=422, field=None):
    """A change of a task's settings, as JSON text or bytes."""
    body = text if isinstance(text, bytes) else text.encode()
    return Attack("PUT", f"/tasks/{LIMITED}", status, field, body, JSON)


def posted(path, body, status, field=None, headers=JSON):
    """A body that is sent to `path`: bytes, or a document."""
    return Attack("POST", path, status, field, body if isinstance(body, bytes) else json.dumps(body).encode(), headers)


def asked(address, status=422, field=None, **headers):
    """A GET of an address with its query."""
    return Attack("GET", address, status, field, headers=headers)


def form(*parts, boundary=BOUNDARY, parameters="", close=True):
    """The body and the headers of a multipart request; each part is (header lines, data)."""
    pieces = [f"--{boundary}\r\n".encode() + head + b"\r\n\r\n" + data + b"\r\n" for head, data in parts]
    body = b"".join(pieces) + (f"--{boundary}--\r\n".encode() if close else b"")
    return body, {"content-type": f"multipart/form-data; boundary={boundary}{parameters}"}


def part(name, data, filename=None):
    """A part as clients write it; `name` may hold what clients would not write."""
    head = b'Content-Disposition: form-data; name="' + name + b'"'
    return (head if filename is None else head + b'; filename="' + filename + b'"'), data


def first_line_of(url, request):
    """The first line of the answer to bytes that are sent as they are; empty where the service says nothing."""
    place = urlsplit(url)
    with socket.create_connection((place.hostname, place.port), timeout=RAW_TIMEOUT_S) as connection:
        connection.sendall(request)
        try:
            return connection.recv(65_536).partition(b"\r\n")[0].decode("latin-1")
        except (TimeoutError, ConnectionError):
            return ""
