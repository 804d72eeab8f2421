"""Every number of every request, as the OpenAPI document lists them, replaced by what arithmetic cannot take."""

import json
from itertools import product

import pytest

from tests.e2e.test_extremes import EPISODE, IMAGES, POSES, PREDICT, SETTINGS
from tests.episodes import upload

TASK = "extremes"
EXTREMES = ("1e155", "-1e155", "1e308", "-1e308", "-0.0", "5e-324", "-5e-324", "NaN", "Infinity", "-Infinity")
JSON = "application/json"
REFUSED = {"/problems/unsafe-action", "/problems/unsupported-action"}  # the model's reply, for an object at height -0.0
BODIES = {
    "/predict": PREDICT,
    "/episodes": EPISODE,
    "/tasks/{name}": SETTINGS,
    "/poses": POSES,
}
IDS = ("episode_id", "prediction_id", "job_id", "run_id")
NOT_FOUND = {"name": TASK, **dict.fromkeys(IDS, "0" * 32)}
ANY = "cube"  # a key of objects that take any


class Numbers:
    """The places of numbers in JSON Schemas."""

    def __init__(self, schemas):
        self._schemas = schemas

    def _of(self, schema):
        return self._schemas[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema

    def places(self, schema, depth=0):
        """Paths of numbers: keys, indices, and branches as ("anyOf", k)."""
        schema = self._of(schema)
        if schema.get("type") in ("number", "integer"):
            yield ()
        if depth > 12:
            return
        for path, inner in self._inner(schema):
            for rest in self.places(inner, depth + 1):
                yield (path, *rest)

    def _inner(self, schema):
        for word in ("anyOf", "oneOf"):
            for k, branch in enumerate(schema.get(word, ())):
                yield (word, k), branch
        yield from schema.get("properties", {}).items()
        if isinstance(more := schema.get("additionalProperties"), dict):
            yield ANY, more
        if "prefixItems" in schema:
            yield 0, schema["prefixItems"][0]
            yield len(schema["prefixItems"]) - 1, schema["prefixItems"][-1]
        elif "items" in schema:
            yield 0, schema["items"]

    def sample(self, schema):
        """A value, so that a number deep within has something around it."""
        schema = self._of(schema)
        for word in ("anyOf", "oneOf"):
            if word in schema:
                return self.sample(schema[word][0])
        if "enum" in schema or "const" in schema:
            return schema.get("const", schema.get("enum", [None])[0])
        kind = schema.get("type")
        if kind == "object":
            return {name: self.sample(schema["properties"][name]) for name in schema.get("required", ())}
        if kind == "array":
            items = schema.get("prefixItems") or [schema.get("items", {})] * max(1, schema.get("minItems", 0))
            return [self.sample(item) for item in items]
        return {"number": 1.0, "integer": 1, "boolean": True, "null": None}.get(kind, ANY)

    def planted(self, schema, value, path):
        """`value` with a mark at a path, and around it what is needed."""
        schema = self._of(schema)
        if not path:
            return "@here@"
        head, *rest = path
        inner = dict(self._inner(schema))[head]
        if isinstance(head, tuple):
            return self.planted(inner, value, rest)
        if isinstance(head, int):
            items = list(value) if isinstance(value, list | tuple) and len(value) > head else self.sample(schema)
            items[head] = self.planted(inner, items[head], rest)
            return items
        members = dict(value) if isinstance(value, dict) else self.sample(schema)
        return {**members, head: self.planted(inner, members.get(head), rest)}


@pytest.fixture(scope="module")
def described(http):
    for number in range(2):
        assert upload(http, TASK, (0.1, 0.1 + number / 10, 0.78)).status_code == 201
    return http.get("/openapi.json").json()


def operations(document):
    return [
        (path, method.upper(), operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]


def require_answer(response, what):
    refused = response.status_code == 502 and response.json()["type"] in REFUSED
    assert response.status_code < 500 or refused, (*what, response.text)
    if "event-stream" in response.headers["content-type"]:
        assert "event: done" in response.text or "event: error" in response.text, what
        assert "/problems/internal" not in response.text, (*what, response.text)


def test_no_number_of_a_body_is_an_unexpected_error(http, described):
    numbers, seen = Numbers(described["components"]["schemas"]), {}
    for path, method, operation in operations(described):
        body = operation.get("requestBody", {}).get("content", {}).get(JSON)
        if body is None:
            continue
        address = path.format(**NOT_FOUND).replace(f"/tasks/{TASK}", f"/tasks/{TASK}_numbers")
        document = BODIES.get(path, {})
        for place, extreme in product(numbers.places(body["schema"]), EXTREMES):
            planted = numbers.planted(body["schema"], document, place)
            text = json.dumps(planted).replace('"@here@"', extreme)
            for accept in (JSON, "text/event-stream") if path == "/predict" else (JSON,):
                headers = {"content-type": JSON, "accept": accept}
                response = http.request(method, address, content=text, headers=headers)
                require_answer(response, (method, path, place, extreme))
                seen.setdefault(path, set()).add(place)
    assert {path for path in BODIES if len(seen.get(path, ())) < 5} == set()
    assert IMAGES  # the images came along


def test_no_number_of_an_address_is_an_unexpected_error(http, described):
    numbers, asked = Numbers(described["components"]["schemas"]), 0
    for path, method, operation in operations(described):
        for parameter in operation.get("parameters", ()):
            if parameter["in"] == "query" and any(numbers.places(parameter["schema"])):
                for extreme in EXTREMES:
                    address = path.format(**NOT_FOUND)
                    response = http.request(method, address, params={parameter["name"]: extreme})
                    require_answer(response, (method, path, parameter["name"], extreme))
                    asked += 1
    assert asked
