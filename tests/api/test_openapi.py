"""The kept OpenAPI document is true, and its examples can be sent as they are."""

import json
from functools import cache
from pathlib import Path

from app.bootstrap import build_app
from app.settings import Settings

SNAPSHOT = Path(__file__).parents[2] / "openapi" / "openapi.json"


@cache
def openapi_text():
    """As `make openapi` writes it."""
    return json.dumps(build_app(Settings()).openapi(), indent=2, sort_keys=True) + "\n"


def test_snapshot_is_what_the_service_says():
    assert SNAPSHOT.read_text() == openapi_text(), "run `make openapi` and look at the difference"


def test_every_reference_resolves():
    text = openapi_text()
    schemas = json.loads(text)["components"]["schemas"]
    referred = {part.split('"')[0] for part in text.split('"#/components/schemas/')[1:]}
    assert referred <= set(schemas)


def test_each_subject_is_described_and_has_operations():
    document = json.loads(openapi_text())
    used = {tag for path in document["paths"].values() for operation in path.values() for tag in operation["tags"]}
    assert {tag["name"] for tag in document["tags"]} == used
