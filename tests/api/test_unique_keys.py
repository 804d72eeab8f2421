"""A key that stands twice in one object is refused; the same key in two objects is not."""

import asyncio
import json

import httpx
import pytest
from fastapi import APIRouter, FastAPI

from app.api.problems import install_problem_handlers
from app.api.routes.tasks import UniqueKeysRoute

JSON = {"content-type": "application/json"}
router = APIRouter(route_class=UniqueKeysRoute)


@router.put("/echo")
def echo(body: dict[str, object]) -> dict[str, object]:
    return body


def put(content):
    async def ask():
        app = FastAPI()
        app.include_router(router)
        install_problem_handlers(app)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            return await client.put("/echo", content=content, headers=JSON)

    return asyncio.run(ask())


@pytest.mark.parametrize(
    "body", ['{"a": 1, "a": 1}', '{"b": [{"c": {"a": 1, "b": 2, "a": 3}}]}', '{"a": 1, "\\u0061": 2}']
)
def test_a_key_that_comes_twice_is_named(body):
    answer = put(body)
    assert (answer.status_code, answer.headers["content-type"]) == (400, "application/problem+json")
    assert "'a' appears twice" in answer.json()["detail"]


def test_other_bodies_are_read_as_ever():
    body = {"a": {"a": [{"a": 1}, {"a": 2}]}, "A": None}
    assert put(json.dumps(body)).json() == body
    assert put("{").status_code == 422
