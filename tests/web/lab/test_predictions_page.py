"""The list of predictions, and one of them."""

import pytest
from playwright.sync_api import expect

from tests.web.conftest import PLACES_M, until
from tests.web.lab.conftest import ask


def fates(page):
    return page.locator("table.list").first.locator("td[data-label=Outcome] .badge").all_inner_texts()


def test_a_filter_narrows_the_list(page):
    page.goto("/ui/predictions")
    page.get_by_label("Outcome").select_option("no actions")
    page.get_by_role("button", name="Filter").click()
    page.wait_for_url("**outcome=refused**")
    assert set(fates(page)) == {"no actions"}
    assert "the reply has 0 lists of actions" in page.locator("tbody").first.inner_text()
    page.goto("/ui/predictions?task=pick&model=scripted&outcome=success")
    assert "No prediction fits the filter" in page.locator("main").inner_text()


def test_pages_go_on_where_the_last_ended(page, http, seeded):
    for _ in range(51):
        ask(http, model="regression", num_demonstrations=2)
    page.goto("/ui/predictions?demonstrations=2")
    first = page.locator("tbody").first.locator("th a").evaluate_all("links => links.map(link => link.href)")
    page.get_by_role("link", name="Further on").click()
    page.wait_for_url("**cursor=**")
    rest = page.locator("tbody").first.locator("th a").evaluate_all("links => links.map(link => link.href)")
    assert (len(first), len(rest), len({*first, *rest})) == (50, 1, 51)


def test_why_a_prediction_failed_in_three_clicks(page, seeded):
    page.goto("/")
    page.get_by_role("row", name="pick").get_by_role("link", name="1 failure").click()
    expect(page.get_by_role("row", name="pick up the cube")).to_contain_text("danger unusual-scene and 1 more")
    page.get_by_role("link", name="pick up the cube").click()
    page.wait_for_url(f"**/ui/predictions/{seeded['failure']}")
    found = page.get_by_role("region", name="Findings")
    assert "cube: y is 0.300 m, demonstrations have" in found.inner_text()
    found.get_by_role("link").first.click()
    row = page.get_by_role("region", name="Object poses").get_by_role("row", name="cube")
    assert "0.550, 0.300, 0.785" in row.inner_text()


def test_a_failure_without_findings_says_where_to_look(page, http):
    between_m = [0.13, 0.04, PLACES_M[1][2]]
    page.goto(f"/ui/predictions/{ask(http, between_m, success=False, model='nearest')}")
    found = page.get_by_role("region", name="Findings")
    assert "something that the service does not know" in found.inner_text()
    found.get_by_role("link", name="its pose").click()
    expect(page.locator("#part-objects")).to_be_in_viewport()


def test_the_path_has_a_row_for_each_action(page, http, seeded):
    rows = page.get_by_role("region", name="Table of actions").locator("tbody tr")
    page.goto(f"/ui/predictions/{seeded['success']}")
    actions = http.get(f"/predictions/{seeded['success']}").json()["actions"]
    assert rows.count() == len(actions)
    assert (
        "known once the task's settings name it" in page.get_by_role("region", name="Actions", exact=True).inner_text()
    )
    try:
        http.put("/tasks/pick", json={"arm": "fr3", "robot_base": [-9, 0, 0]})
        page.reload()
        assert rows.locator("td[data-label=Reach]").all_inner_texts()[0].startswith("no")
        http.put("/tasks/pick", json={"robot_base": [-0.3, 0, 0.7]})
        page.reload()
        reaches = rows.locator("td[data-label=Reach]").all_inner_texts()
        assert [text.split()[0] for text in reaches] == ["yes"] * len(actions)
        assert all("limit" in text for text in reaches)
    finally:
        http.put("/tasks/pick", json={"arm": None, "robot_base": [0, 0, 0]})


def test_a_prediction_shows_what_was_asked_and_what_came(page, seeded):
    page.goto(f"/ui/predictions/{seeded['failure']}")
    prompt = page.locator("pre.long")
    assert prompt.locator(".object").count() == 5
    assert prompt.locator(".instruction").count() == 5
    assert prompt.locator(".action").count() == 4
    assert page.locator("#part-reply .action").count() == 1
    assert "went beside the cube" in page.locator("main").inner_text()
    view = page.locator("#space-view")
    view.locator(".shown").first.wait_for()
    assert view.locator(".shown").count() == 4
    page.get_by_role("button", name="Whole workspace").click()
    assert view.locator(".frame").count() == 3
    page.locator("ol.demonstrations a").first.click()
    page.wait_for_url("**/ui/episodes/*")


def test_a_prediction_plays_before_a_robot_moves(page, http, seeded):
    try:
        http.put("/tasks/pick", json={"arm": "panda", "robot_base": [-0.3, 0, 0.7]})
        page.goto(f"/ui/predictions/{seeded['success']}")
        player = page.get_by_role("group", name="Play the motion")
        assert player.locator(".mark").count() == 3
        player.get_by_role("button", name="Play").click()
        until(page, "document.querySelector('.clock').textContent.startsWith('0.00') === false")
        assert page.locator("#space-view .arm circle").count() == 9
        page.get_by_role("button", name="From above").click()  # along some links
        # In one turn: each frame of the motion has links of its own.
        links = "[...document.querySelectorAll('#space-view .link')]"
        widths_px = page.evaluate(f"{links}.map((link) => link.getBBox().width)")
        assert (len(widths_px), min(widths_px) > 2) == (8, True)
        assert page.locator("#space-view .gripper.ghost").count() == 3
    finally:
        http.put("/tasks/pick", json={"arm": None, "robot_base": [0, 0, 0]})


def test_a_demonstration_plays_beside_it_from_mark_to_mark(page, http, seeded):
    page.goto(f"/ui/predictions/{seeded['success']}")
    view = page.locator("#space-view")
    expect(view.locator(".shown")).to_have_count(4)
    page.get_by_label("Beside it").select_option(index=2)
    expect(view.locator(".gripper.beside")).to_have_count(1)
    assert view.locator(".shown").count() == 1
    marks = page.locator(".timeline .mark").evaluate_all("lines => lines.map(line => line.getAttribute('x1') / 1000)")
    moment = page.get_by_label("Moment of the motion")
    end_s = float(moment.get_attribute("max"))
    moment.fill(f"{marks[1] * end_s:.2f}")
    # at the prediction's second action the demonstration's hand is at its second keyframe, right above its own cube
    (cube,) = view.locator(".shown").evaluate_all("dots => dots.map(dot => Number(dot.getAttribute('cx')))")
    fingers = view.locator(".beside polyline").first.get_attribute("points").split()
    middle = sum(float(point.split(",")[0]) for point in (fingers[0], fingers[-1])) / 2
    assert middle == pytest.approx(cube, abs=3)


def test_an_outcome_is_reported_with_a_note(page, http):
    id_ = ask(http, model="regression")
    page.goto(f"/ui/predictions/{id_}")
    page.get_by_label("Note").fill("dropped it")
    page.get_by_label("Note").press("Enter")  # chooses no outcome
    page.get_by_role("button", name="Failure").click()
    page.locator("h1 .badge.failure").wait_for()
    assert http.get(f"/predictions/{id_}").json()["outcome"]["note"] == "dropped it"


def test_success_is_counted_by_model_and_settings(page):
    page.goto("/ui/predictions?task=pick")
    page.get_by_role("link", name="Success of each model").click()
    page.wait_for_url("**/ui/tasks/pick#success")
    table = page.get_by_role("table", name="Success by model and settings")
    row = table.get_by_role("row").filter(has_text="regression").filter(has_text="object_frame")
    assert "100" in row.locator("td[data-label=Success]").inner_text()
    assert row.locator("td[data-label=Interval]").inner_text() == "21\N{EN DASH}100\N{NO-BREAK SPACE}%"
    row.get_by_role("link").click()
    page.wait_for_url("**representation=object_frame**")
    assert fates(page) == ["succeeded"]
