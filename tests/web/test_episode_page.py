"""One episode: what was recorded, what was made of it, what another rule would make."""

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory
from tests.web.conftest import PLACES_M, teach, until


def see_the_plot(page):
    page.locator("#speed").scroll_into_view_if_needed()
    page.locator("#speed .curve").wait_for(state="attached")


def xs(page, lines):
    """Where upright lines of the plot stand, as shares of its width."""
    return page.locator(f"#speed {lines}").evaluate_all(
        """(lines) => {
          const { width } = document.querySelector("#speed .open, #speed .closed").parentNode.viewBox.baseVal;
          return lines.map((line) => (line.getAttribute("x1") - 56) / (width - 56 - 16));
        }"""
    )


@pytest.fixture
def episode(page, seeded):
    page.goto(f"/ui/episodes/{seeded[0]['id']}")
    return seeded[0]


def set_slider(page, exponent):
    """As a person drags it: the value, then the event."""
    page.locator("#delta-slider").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input', { bubbles: true })); }",
        exponent,
    )


def place(view):
    """Where the floor is drawn: all the rest stands above one point."""
    return view.locator(".floor").get_attribute("points")


def far_apart(view):
    """Pixels between the highest and the lowest keyframe."""
    heights = view.locator(".frame").evaluate_all("rings => rings.map(ring => Number(ring.getAttribute('cy')))")
    return max(heights) - min(heights)


def frames(page):
    return [int(text) for text in page.locator("#table tbody td:nth-child(2)").all_inner_texts()]


def test_the_camera_s_image_is_shown_with_the_poses(page, episode):
    image = page.get_by_alt_text("First image of camera front with cube marked")
    assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") == 64
    expect(page.get_by_role("row", name="cube")).to_contain_text("0.100, 0.000, 0.785")


def test_the_plot_has_speed_threshold_gripper_and_keyframes_in_both_modes(page, episode):
    see_the_plot(page)
    plot = page.locator("#speed")
    assert plot.locator("line.threshold").get_attribute("data-rad-s") == "0.1"
    assert plot.locator("rect").count() == 2
    last = episode["num_frames"] - 1
    assert xs(page, ".keyframe") == pytest.approx([item["index"] / last for item in episode["keyframes"]])
    assert len(plot.locator(".curve").get_attribute("points").split()) == episode["num_frames"]
    stroke = "getComputedStyle(document.querySelector('#speed .curve')).stroke"
    light = page.evaluate(stroke)
    page.emulate_media(color_scheme="dark")
    until(page, f"light => {stroke} !== light", light)


def test_the_slider_shows_at_once_what_would_be_found(page, episode, http):
    see_the_plot(page)
    assert frames(page) == [6, 11, 20]
    set_slider(page, 0)
    expect(page.locator("#table [role=status]")).to_contain_text("gone")
    until(page, "!(document.querySelector('#speed line.threshold')?.dataset.radS < 1)")
    assert page.get_by_label("rad/s").input_value() == "1"
    assert "delta_rad_s=1" in page.url
    page.reload()
    expect(page.locator("#table [role=status]")).to_contain_text("gone")
    page.get_by_role("button", name="As stored").click()
    expect(page.locator("#table [role=status]")).to_have_text("3 keyframes, as stored")
    assert "?" not in page.url
    assert [item["index"] for item in http.get(f"/episodes/{episode['id']}").json()["keyframes"]] == [6, 11, 20]


def test_long_lists_are_cut_short(http):
    trajectory = {name: np.repeat(array, 20, axis=0) for name, array in arrays(pick_trajectory(PLACES_M[0])).items()}
    files = multipart(metadata("long", {"cube": PLACES_M[0]}), npz(**trajectory))
    id_ = http.post("/episodes", files=files).json()["id"]
    answer = http.get(f"/ui/episodes/{id_}/keyframes", params={"rule": "uniform", "interval": 1}).json()
    assert len(answer["keyframes"]) == len(answer["frames"]) == answer["html"].count('<tr class="new">') + 2 == 300
    assert "419 keyframes" in answer["html"]
    assert "Only the first 300" in answer["html"]


def test_a_rule_is_applied_to_the_whole_task(page, http):
    taught = [teach(http, "applied", place_m)["id"] for place_m in PLACES_M[:2]]
    page.goto(f"/ui/episodes/{taught[0]}")
    expect(page.get_by_role("button", name="Apply to the task")).to_be_disabled()
    page.get_by_label("Rule").select_option("uniform")
    page.get_by_label("Every n-th frame").fill("9")
    page.get_by_role("button", name="Apply to the task").click()
    expect(page.get_by_role("dialog")).to_contain_text("All 2 episodes of applied")
    page.get_by_role("dialog").get_by_role("button", name="Apply").click()
    page.wait_for_url("**?applied=true")
    expect(page.locator("#table [role=status]")).to_have_text("3 keyframes, as stored")
    for id_ in taught:
        assert [item["index"] for item in http.get(f"/episodes/{id_}").json()["keyframes"]] == [9, 18, 20]


def test_the_scene_is_drawn_in_space(page, episode):
    view = page.locator("#space-view")
    view.locator(".frame").first.wait_for()
    assert len(view.locator("polyline.path").get_attribute("points").split()) == episode["num_frames"] + 1
    assert view.locator(".frame").count() == len(episode["keyframes"])
    assert view.locator("text.number").all_text_contents() == ["1", "2", "3"]
    assert view.locator("text.named").all_text_contents() == ["cube"]
    assert view.locator(".solid title").text_content() == "cube\n0.100, 0.000, 0.785 m"
    close = far_apart(view)
    page.get_by_role("button", name="Whole workspace").click()
    assert page.get_by_role("button", name="Whole workspace").get_attribute("aria-pressed") == "true"
    assert view.locator(".workspace").count() == 1
    assert close > 2 * far_apart(view) > 0
    page.get_by_role("button", name="Close to the motion").click()
    assert far_apart(view) == pytest.approx(close)


def test_a_recording_plays_and_is_gone_through_by_keyboard(page, episode):
    player = page.get_by_role("group", name="Play the motion")
    moment = player.get_by_label("Moment of the motion")
    expect(player.locator(".mark")).to_have_count(3)
    moment.focus()
    page.keyboard.press("End")
    assert player.locator(".clock").inner_text() == "1.00 of 1.00 s"
    hands = [page.locator("#space-view .hand polyline").first.get_attribute("points")]
    page.keyboard.press("ArrowLeft")
    assert player.locator(".clock").inner_text() == "0.90 of 1.00 s"
    page.locator("#space-view").focus()
    page.keyboard.press(" ")
    until(page, "document.querySelector('.clock').textContent === '1.00 of 1.00 s'")
    page.keyboard.press(" ")
    until(page, "document.querySelector('.player .play').textContent === 'Play'")
    player.locator(".timeline svg").click(position={"x": 1, "y": 20})
    hands.append(page.locator("#space-view .hand polyline").first.get_attribute("points"))
    assert len(set(hands)) == 2


def test_the_text_is_that_of_the_prompt(page, episode, http):
    page.locator("#text").scroll_into_view_if_needed()
    usual = page.locator("#text details[open] pre").inner_text()
    body = {"task": "pick", "instruction": "pick up the cube", "dry_run": True}
    body["objects"] = [{"name": "cube", "position": PLACES_M[3]}]
    assert http.post("/predict", json=body).json()["prompt"]["user"].startswith(usual.strip())
    assert (
        page.locator("#text details[open] .action").first.evaluate("part => getComputedStyle(part).color")
        == "rgb(0, 90, 156)"
    )
    page.get_by_text("object_frame, format paper").click()
    expect(page.locator("#text details").nth(1).locator(".object").first).to_be_visible()


def test_it_is_useful_without_scripts(browser, url, seeded):
    context = browser.new_context(base_url=url, java_script_enabled=False)
    plain = context.new_page()
    plain.goto(f"/ui/episodes/{seeded[0]['id']}")
    plain.get_by_label("Rule").select_option("uniform")
    plain.get_by_role("button", name="Show").click()
    expect(plain.locator("#table [role=status]")).to_contain_text("new")
    assert "rule=uniform" in plain.url
    plain.get_by_role("link", name="Its text").click()
    expect(plain.locator("details[open] pre")).to_contain_text("pick up the cube")
    context.close()
