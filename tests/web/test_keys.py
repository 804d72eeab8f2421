"""Pages where keys are required: the browser asks for user and password, and then sends them by itself."""

import httpx
import pytest
from playwright.sync_api import expect

from app.services.api_keys import create_key
from app.store.store import Store
from tests.e2e.processes import running_server
from tests.web.conftest import PLACES_M, teach, watched_page


@pytest.fixture(scope="module")
def guarded(tmp_path_factory):
    """The address of a service that wants keys, and a key that may teach."""
    data = tmp_path_factory.mktemp("guarded")
    store = Store.open(data)
    key = create_key(store, "lab", "teach")
    store.close()
    environment = {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_DEFAULT_MODEL": "regression"}
    with running_server(data, environment) as address:
        with httpx.Client(base_url=address, auth=("lab", key), timeout=60) as http:
            teach(http, "pick", PLACES_M[0])
        yield address, key


def test_the_key_is_the_password(browser, guarded):
    address, key = guarded
    password = {"username": "anyone", "password": key}
    context = browser.new_context(base_url=address, http_credentials=password)
    with context, watched_page(context.new_page(), address) as page:
        page.expected_refusals = [403]  # the key may not delete
        page.goto("/ui/episodes")
        picture = page.locator("tbody img").first
        assert picture.evaluate("image => image.decode().then(() => image.naturalWidth)") > 0
        page.get_by_role("button", name="Delete episode").first.click()
        page.get_by_role("dialog").get_by_role("button", name="Delete").click()
        expect(page.get_by_role("alert")).to_contain_text("this needs admin")
