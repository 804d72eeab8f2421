"""Pages where keys are required."""

import json
import time

import httpx
import pytest
from playwright.sync_api import expect

from app.bootstrap import DEFAULT_RATE_PER_S
from app.services.api_keys import create_key
from app.store.store import Store
from tests.e2e.processes import running_server
from tests.web.conftest import PLACES_M, teach, watched_page

NUM_EPISODES = 50  # a whole page of pictures: more requests at once than the rate limit lets robots send


@pytest.fixture(scope="module")
def guarded(tmp_path_factory):
    """The address of a service that wants keys, and a key that may read and upload."""
    data = tmp_path_factory.mktemp("guarded")
    store = Store.open(data)
    key = create_key(store, "lab", ["read", "upload"])
    store.close()
    environment = {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_DEFAULT_MODEL": "regression", "ROBOPROMPT_WARM_UP": "false"}
    with running_server(data, environment) as address:
        headers = {"authorization": f"Bearer {key}"}
        with httpx.Client(base_url=address, headers=headers, timeout=60) as http:
            for number in range(NUM_EPISODES):
                teach(http, "pick", PLACES_M[0], hue=number)
                time.sleep(1.5 / DEFAULT_RATE_PER_S)
        yield address, key


@pytest.fixture(scope="module")
def tab(browser, guarded):
    context = browser.new_context(base_url=guarded[0])
    yield context.new_page()
    context.close()


@pytest.fixture
def page(tab, guarded):
    """Of somebody who has not logged in."""
    tab.context.clear_cookies()
    with watched_page(tab, guarded[0]) as page:
        yield page


def log_in(page, key):
    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Log in").click()


def test_a_key_opens_the_pages_with_all_their_pictures(page, guarded):
    page.goto("/ui/episodes")
    assert page.url.endswith("/ui/login?next=/ui/episodes")
    log_in(page, guarded[1])
    page.wait_for_url(f"{guarded[0]}/ui/episodes")
    pictures = page.locator("tbody img")
    expect(pictures).to_have_count(NUM_EPISODES)
    for picture in pictures.all():
        picture.scroll_into_view_if_needed()
        assert picture.evaluate("image => image.decode().then(() => image.naturalWidth)") > 0
    page.get_by_role("button", name="Log out").click()
    page.wait_for_url("**/ui/login")


def test_what_a_key_may_not_do_is_reported(page, guarded):
    page.expected_refusals = [403]
    page.goto("/ui/episodes")
    log_in(page, guarded[1])
    page.wait_for_url(f"{guarded[0]}/ui/episodes")
    page.get_by_role("button", name="Delete episode").first.click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(page.get_by_role("alert")).to_contain_text("this needs admin")


def test_who_was_logged_out_meanwhile_logs_in_again(page, guarded, tmp_path):
    page.expected_refusals = [401]
    (tmp_path / "episode.json").write_text(
        json.dumps({"metadata": {"task": "pick"}, "trajectory": {"gripper_open": []}})
    )
    page.goto("/ui/upload")
    log_in(page, guarded[1])
    page.wait_for_url(f"{guarded[0]}/ui/upload")
    page.context.clear_cookies()
    page.get_by_label("Choose files").set_input_files(tmp_path / "episode.json")
    page.wait_for_url("**/ui/login?next=%2Fui%2Fupload")
