"""The first page: what was taught, and how it fares."""

import pytest

from tests.web.conftest import PLACES_M, teach, until, until_pictures_are_there


def test_the_entrance_leads_to_the_tasks(page, seeded):
    page.goto("/")
    assert page.url.endswith("/ui/tasks")
    row = page.get_by_role("row", name="pick")
    assert row.locator("td[data-label=Episodes]").inner_text() == "4"
    assert row.locator("td[data-label=Success]").inner_text() == "yardsticks: 1 of 2, 1 failure"
    assert page.get_by_role("navigation").get_by_role("link", name="Tasks").get_attribute("aria-current") == "page"


def test_pictures_are_shown(page):
    page.goto("/ui/tasks")
    picture = page.get_by_role("row", name="pick").locator("img")
    until(page, "image => image.complete", picture.element_handle())
    assert picture.evaluate("image => image.naturalWidth") == 192


def test_tasks_of_evaluations_stand_apart_and_are_named_in_words(page, http):
    name = "pick-vision.eval-0fe741"
    try:
        teach(http, name, PLACES_M[0])
        page.goto("/ui/tasks")
        link = page.get_by_role("link", name="pick-vision, evaluation 0fe741", exact=True)
        assert not link.is_visible()
        page.get_by_text("1 task of evaluations").click()
        link.click()
        page.wait_for_url("**/ui/episodes?task=pick-vision.eval-0fe741")
        assert page.get_by_role("heading", level=1).inner_text() == "Episodes of pick-vision, evaluation 0fe741"
        assert page.locator("optgroup option").evaluate("option => [option.value, option.selected]") == [name, True]
        page.goto("/ui/tasks?q=vision")
        assert page.get_by_role("link", name="pick-vision, evaluation 0fe741", exact=True).is_visible()
        until_pictures_are_there(page)
    finally:
        for episode in http.get("/episodes", params={"task": name}).json()["episodes"]:
            http.delete(f"/episodes/{episode['id']}")


def test_a_filter_narrows_the_list(page, http):
    page.goto("/ui/tasks")
    page.get_by_label("Name or object contains").fill("CUBE")
    page.keyboard.press("Enter")
    page.wait_for_url("**/ui/tasks?q=CUBE")
    assert page.get_by_role("row", name="pick").is_visible()
    assert not page.get_by_role("row", name="bare").is_visible()
    names = [(task["name"], *(task["object_names"] or [])) for task in http.get("/tasks").json()["tasks"]]
    found = [words for words in names if any("cube" in word for word in words)]
    assert page.get_by_role("status").inner_text() == f"{len(found)} of {len(names)} tasks"
    page.goto("/ui/tasks?q=<script>")
    assert "No task has “<script>”" in page.locator("main").inner_text()


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 360)])
def test_it_can_be_read_by_everyone(page, check_accessibility, scheme, width):
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/ui/tasks")
    check_accessibility(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_keyboard_reaches_the_content(page):
    page.goto("/ui/tasks")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"


def test_an_unknown_page_says_so(page):
    page.expected_refusals = [404]
    page.goto("/ui/nowhere")
    assert "there is no page /ui/nowhere" in page.get_by_role("alert").inner_text()
