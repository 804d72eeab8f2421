"""Multipart bodies that no client should send."""

import json

from tests.attack.hostile import Attack, form, part
from tests.attack.payloads import QUESTION

DOCUMENT = json.dumps(QUESTION).encode()
METADATA = part(b"metadata", DOCUMENT, b"m.json")


def sent(status, field, *parts, path="/predict", **more):
    """A form of these parts."""
    body, headers = form(*parts, **more)
    return Attack("POST", path, status, field, body, headers)


def of_charset(charset, data, name=b"metadata"):
    """A form whose one field is written in a charset of its own."""
    return sent(415, None, part(name, data), parameters=f"; charset={charset}")


FORMS = {
    "a boundary of 10 kB": sent(400, None, METADATA, boundary="b" * 10_000),
    "another boundary than was announced": Attack(
        "POST", "/predict", 400, None, form(METADATA, boundary="other")[0], form()[1]
    ),
    "a boundary only": sent(422, "metadata"),
    "no last boundary": sent(422, "metadata", METADATA, close=False),
    "10,000 files": sent(400, None, *[part(b"f%d" % k, b"", b"f") for k in range(10_000)]),
    "10,000 fields": sent(400, None, *[part(b"f%d" % k, b"") for k in range(10_000)]),
    "a part without a name": sent(400, None, METADATA, (b"Content-Disposition: form-data", b"x")),
    "a part with an empty name": sent(422, None, METADATA, part(b"", b"x", b"f")),
    "a part of 10,000 headers": sent(400, None, METADATA, (b"\r\n".join([b"A: b"] * 10_000), b"x")),
    "metadata twice": sent(422, "metadata", METADATA, METADATA),
    "a name that leads upwards": sent(422, "../../etc", METADATA, part(b"../../etc/passwd", b"x", b"f")),
    "a name of 100 kB": sent(400, None, METADATA, part(b"n" * 100_000, b"x", b"f")),
    "a name with bare line ends": sent(422, '"rgb_', METADATA, part(b"rgb_\r\nX: y", b"x", b"f")),
    "a name that is not UTF-8": sent(422, "rgb_", METADATA, part(b"rgb_\xff\xfe", b"x", b"f")),
    "charset idna": of_charset("idna", b"a" * 64 + b"." + DOCUMENT),
    "charset punycode, slow": of_charset("punycode", b"a-" + b"99" * 20_000),
    "charset UTF-7 with half a surrogate pair": of_charset("utf-7", b'{"task": "+2AA-"}'),
    "charset of 10 kB": of_charset("a" * 10_000, b"x"),
    "a form within a form": sent(400, None, part(b"metadata", form(METADATA, boundary="inner")[0], b"m.json")),
    "metadata in base64": sent(
        400, None, (METADATA[0] + b"\r\nContent-Transfer-Encoding: base64", b"e30="), path="/episodes"
    ),
    "a form for settings": Attack("PUT", "/tasks/limited", 422, None, *form(METADATA)),
}
