"""A task's settings as a form."""

import pytest
from playwright.sync_api import expect

from tests.web.conftest import PLACES_M, teach

PANEL = {"keep_out": [{"min": [0.5, -0.1, 0.7], "max": [0.6, 0.1, 0.9]}]}


@pytest.fixture
def form(page, http):
    teach(http, "set by hand", PLACES_M[0])
    page.goto("/ui/tasks/set%20by%20hand")
    yield page
    http.delete("/tasks/set by hand").raise_for_status()


def settings_of(http):
    document = http.get("/tasks/set by hand").json()
    return {name: value for name, value in document.items() if name not in ("version", "updated_at")}


def test_what_changes_is_written_and_drawn_then_applied(form, http):
    expect(form.get_by_role("button", name="Apply")).to_be_disabled()
    form.get_by_role("button", name="Add a box").click()
    form.get_by_label("from x y z, m").last.fill("0.5 -0.1 0.7")
    form.get_by_label("to x y z, m").last.fill("0.6 0.1 0.9")
    form.get_by_label("Arm").select_option("ur5e")
    form.get_by_label("Other words for cube").fill("block, brick")
    expect(form.locator("#changes li")).to_have_count(3)
    expect(form.locator("#space-view .keep-out")).to_have_count(1)
    form.get_by_role("button", name="Apply").click()
    expect(form.locator("#state")).to_have_text("Applied.")
    expect(form.get_by_label("Arm")).to_have_value("ur5e")
    settings = settings_of(http)
    assert settings["motion_limits"]["keep_out"] == PANEL["keep_out"]
    assert (settings["arm"], settings["aliases"]) == ("ur5e", {"cube": ["block", "brick"]})


def test_what_somebody_else_set_meanwhile_is_not_overwritten(form, http):
    form.expected_refusals = [409]
    http.put("/tasks/set by hand", json={"motion_limits": PANEL}).raise_for_status()
    form.get_by_role("button", name="Add a box").click()
    form.get_by_label("from x y z, m").last.fill("0.1 0.1 0.7")
    form.get_by_label("to x y z, m").last.fill("0.2 0.2 0.9")
    form.get_by_role("button", name="Apply").click()
    expect(form.get_by_role("alert")).to_contain_text("read it again")
    assert settings_of(http)["motion_limits"]["keep_out"] == PANEL["keep_out"]


def test_a_setting_that_is_not_valid_is_reported(form, http):
    form.expected_refusals = [422]
    form.get_by_label("Position of its base").fill("1 2")
    expect(form.locator("#changes")).to_contain_text("robot_base is “1 2”. Valid: 3 numbers")
    expect(form.get_by_role("button", name="Apply")).to_be_disabled()
    form.get_by_label("Position of its base").fill("0 0 0")
    form.get_by_label("Source").select_option("a box of your own")
    form.get_by_label("from x y z, m").first.fill("9 9 9")
    form.get_by_role("button", name="Apply").click()
    expect(form.get_by_role("alert")).to_contain_text("workspace")


def test_the_map_shows_where_it_was_shown_and_asked_and_leads_there(page, http, seeded):
    page.goto("/ui/tasks/pick")
    expect(page.locator("#space-view .shown")).to_have_count(len(seeded))
    page.get_by_role("button", name="From above").click()
    expect(page.locator(".asked.success")).to_have_count(1)
    (failed,) = http.get("/predictions", params={"task": "pick", "outcome": "failure"}).json()["predictions"]
    ring = page.locator(f".asked.failure[data-id='{failed['id']}']")
    ring.evaluate("ring => ring.parentNode.append(ring)")  # the other stands at the same place
    ring.scroll_into_view_if_needed()
    ring.click(force=True)
    page.wait_for_url(f"**/ui/predictions/{failed['id']}")
