"""What the server says about the pages."""

import asyncio
import re
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from fastapi import FastAPI

from app.web import page
from app.web.routes import install_pages


def test_pages_may_load_nothing_from_elsewhere(http):
    answer = http.get("/ui/tasks")
    policy = dict(part.split(" ", 1) for part in answer.headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == "'self'"
    assert policy["frame-ancestors"] == "'none'"
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_assets_are_kept_forever(http):
    style = re.search(r'href="(/ui/static/\w+/style\.css)"', http.get("/ui/tasks").text)[1]
    assert "immutable" in http.get(style).headers["cache-control"]


@pytest.mark.parametrize(("built", "status", "said"), [(True, 200, "Welcome"), (False, 404, "make docs")])
def test_guide_is_served_where_it_is_built(tmp_path, monkeypatch, built, status, said):
    if built:
        (tmp_path / "site").mkdir()
        (tmp_path / "site/index.html").write_text("Welcome")
    monkeypatch.setattr(page, "SITE", tmp_path / "site")
    app = FastAPI()
    install_pages(app)

    async def get():
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            return await client.get("/docs/guide/")

    # Playwright's event loop runs in this thread where a test of a page came before.
    with ThreadPoolExecutor() as threads:
        answer = threads.submit(asyncio.run, get()).result()
    assert (answer.status_code, said in answer.text) == (status, True)
