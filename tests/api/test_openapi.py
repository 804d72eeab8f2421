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


def test_every_json_body_has_an_example():
    """Swagger UI would otherwise offer `"string"` and `left_out: true` to be sent."""
    document = json.loads(openapi_text())
    for path, item in document["paths"].items():
        for method, operation in item.items():
            content = operation.get("requestBody", {"content": {}})["content"].get("application/json")
            if content is not None:
                name = json.dumps(content["schema"]).partition("schemas/")[2].partition('"')[0]
                shown = content.get("examples") or document["components"]["schemas"][name].get("examples")
                assert shown, (method, path)
