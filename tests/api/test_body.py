"""A request's content, whichever way it was sent."""

from app.api.body import Body


def test_digest_depends_on_content_only():
    one, same = Body({"a": 1, "b": 2}, {"x": b"1", "y": b"2"}), Body({"b": 2, "a": 1}, {"y": b"2", "x": b"1"})
    assert one.digest() == same.digest()
    assert Body({}, {"x": b"1"}).digest() != Body({}, {"x": b"2"}).digest()
    assert Body({}, {"x": b"1", "y": b""}).digest() != Body({}, {"x": b"", "y": b"1"}).digest()
