"""The list of episodes: found, turned over, deleted."""

import pytest
from playwright.sync_api import expect

from tests.episodes import upload
from tests.web.conftest import PLACES_M, teach, until_pictures_are_there

PAGE_SIZE = 50


@pytest.fixture(scope="module")
def many(http):
    """A task of more episodes than a page holds; the oldest differs by its instruction."""
    first = upload(http, "many", PLACES_M[0], instruction="lift the 100% cotton cube").json()
    rest = [upload(http, "many", PLACES_M[k % 4]).json() for k in range(PAGE_SIZE)]
    return [first, *rest]


def test_a_task_s_episodes_are_listed_with_pictures(page, seeded):
    page.goto("/ui/tasks")
    page.get_by_role("link", name="pick", exact=True).click()
    page.wait_for_url("**/ui/episodes?task=pick")
    expect(page.locator("tbody tr")).to_have_count(len(seeded))
    assert page.locator("tbody img").first.evaluate("image => image.decode().then(() => image.naturalWidth)") > 0
    assert "1 of 2" in page.locator("dl.facts").inner_text()
    page.locator("tbody th a").first.click()
    assert page.url.endswith(seeded[-1]["id"])


def test_older_ones_follow(page, many):
    page.goto("/ui/episodes?task=many")
    expect(page.locator("tbody tr")).to_have_count(PAGE_SIZE)
    page.get_by_role("link", name="Older").click()
    expect(page.locator("tbody tr")).to_have_count(len(many) - PAGE_SIZE)
    assert many[0]["id"] in page.locator("tbody a").first.get_attribute("href")
    page.get_by_role("link", name="Newest").click()
    expect(page.locator("tbody tr")).to_have_count(PAGE_SIZE)


def test_deletion_asks_first(page, http):
    kept, gone = (teach(http, "deletion", place_m)["id"] for place_m in PLACES_M[:2])
    page.goto("/ui/episodes?task=deletion")
    until_pictures_are_there(page)
    button = page.get_by_role("button", name=f"Delete episode {gone[:8]}")
    button.focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    assert http.get(f"/episodes/{gone}").status_code == 200
    assert button.evaluate("button => document.activeElement === button")
    button.click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(page.get_by_role("status")).to_contain_text("Deleted")
    assert http.get(f"/episodes/{gone}").status_code == 404
    expect(page.locator("tbody tr")).to_have_count(1)
    assert kept in page.evaluate("document.activeElement.href")


def test_what_the_service_refuses_is_shown(page, http):
    id_ = teach(http, "deletion", PLACES_M[2])["id"]
    page.expected_refusals = [404]
    page.goto("/ui/episodes?task=deletion")
    until_pictures_are_there(page)
    http.delete(f"/episodes/{id_}")
    page.get_by_role("button", name=f"Delete episode {id_[:8]}").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(page.get_by_role("alert")).to_contain_text(f"there is no episode {id_!r}")


def test_empty_and_unknown_tasks_say_so(page):
    page.expected_refusals = [404, 422]
    page.goto("/ui/episodes?task=bare")
    expect(page.locator(".empty")).to_contain_text("No episode of bare yet")
    page.goto("/ui/episodes?task=nowhere")
    expect(page.get_by_role("alert")).to_contain_text("nowhere")
    page.goto("/ui/episodes?cursor=zero")
    expect(page.get_by_role("alert")).to_contain_text("cursor")


def test_an_episode_is_corrected_left_out_and_found_again(page, http):
    taught = teach(http, "corrected", PLACES_M[0])
    page.goto(f"/ui/episodes/{taught['id']}")
    page.get_by_text("Correct it…").click()
    page.expected_refusals = [422]
    page.get_by_label("Instruction").fill("pick up the spoon")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#corrected").get_by_role("alert")).to_contain_text("spoon")
    page.get_by_label("Instruction").fill("lift the cube")
    page.get_by_label("Leave it out of prompts").check()
    page.get_by_label("Note, for people").fill("the cube slipped")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", name="lift the cube")).to_be_visible()
    expect(page.get_by_text("left out of prompts", exact=True)).to_be_visible()
    page.goto("/ui/episodes?task=corrected")
    expect(page.locator("#episodes")).to_contain_text("left out the cube slipped")
    page.get_by_label("In prompts").select_option("shown")
    page.get_by_role("button", name="Filter").click()
    expect(page.get_by_text("No episode of corrected fits the filter.")).to_be_visible()
    page.get_by_role("link", name="1 left out of prompts").click()
    expect(page.locator("#episodes tbody tr")).to_have_count(1)
    until_pictures_are_there(page)
    http.delete(f"/episodes/{taught['id']}")


def test_filters_go_along_from_page_to_page(page, http):
    ids = [teach(http, "sifted", PLACES_M[k], control_frequency_hz=20 + 5 * k)["id"] for k in range(2)]
    page.goto("/ui/episodes?task=sifted&limit=1&min_duration_s=0.5")
    expect(page.get_by_label("At least, s")).to_have_value("0.5")
    page.get_by_role("link", name="Older").click()
    expect(page.locator("tbody tr")).to_have_count(1)
    expect(page.get_by_label("At least, s")).to_have_value("0.5")
    page.get_by_label("at most, s").fill("0.9")
    page.get_by_label("From").fill("2026-01-01")
    page.get_by_role("button", name="Filter").click()
    expect(page.get_by_text("1 fits the filter")).to_be_visible()
    page.get_by_label("to", exact=True).fill("2026-01-02")
    page.get_by_role("button", name="Filter").click()
    expect(page.get_by_text("No episode of sifted fits the filter.")).to_be_visible()
    for id_ in ids:
        http.delete(f"/episodes/{id_}")
