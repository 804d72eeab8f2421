"""Asking for a prediction and watching it come."""

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory, png
from tests.web.conftest import picture, until, wait_until

SLOW = "openai_compatible/default"


def predict(page, model):
    page.get_by_label("Model", exact=True).select_option(model)
    page.get_by_role("button", name="Predict", exact=True).click()


def state(page, kind):
    place = page.locator(f"#state .{kind}")
    place.wait_for()
    return place.inner_text()


def test_a_prediction_comes(page, http):
    page.goto("/ui/predict?task=pick")
    page.get_by_label("x, m").fill("0.2")
    page.get_by_label("y, m").fill("0.05")
    predict(page, "regression")
    assert state(page, "good").startswith("3 actions in ")
    assert page.locator("#prompt pre .object").count() == 5
    assert page.locator("#part-reply .action").count() == 1
    until(page, "document.querySelectorAll('#space-view .frame').length === 3")
    page.get_by_role("button", name="Success").click()
    until(page, "document.querySelector('#state').innerText === 'Recorded: success.'")
    page.get_by_role("link", name="Open this prediction").click()
    page.wait_for_url("**/ui/predictions/*")
    stored = http.get(f"/predictions/{page.url.rpartition('/')[2]}").json()
    assert stored["objects"][0]["position"][:2] == [0.2, 0.05]
    assert stored["outcome"]["success"] is True


def test_the_reply_is_seen_while_it_comes(page, slow_provider):
    page.goto("/ui/predict?task=pick")
    predict(page, SLOW)
    until(page, "document.querySelectorAll('#space-view .frame').length === 1")
    assert page.locator("#reply").text_content() == " ".join(slow_provider.reply.split(" ")[:7]) + " "
    assert page.get_by_role("button", name="Cancel").is_visible()
    slow_provider.go_on.set()
    assert state(page, "good").startswith("3 actions in ")
    assert not page.get_by_role("button", name="Cancel").is_visible()


def test_what_is_typed_while_an_episode_is_read_stays(page, http, seeded):
    page.goto("/ui/predict?task=pick")
    chosen = page.locator("#episode option").last.get_attribute("value")
    held = []
    page.route(f"**/episodes/{chosen}", lambda route: held.append(route))
    page.get_by_label("x, m").fill("0.1111")
    page.locator("#episode").select_option(chosen)
    page.get_by_label("y, m").fill("0.4242")
    wait_until(lambda: page.evaluate("1") and held)  # a route is handled only while something is asked of the page
    held[0].continue_()
    place = http.get(f"/episodes/{chosen}").json()["objects"][0]["position"]
    expect(page.get_by_label("x, m")).to_have_value(f"{place[0]:.4f}")
    expect(page.get_by_label("y, m")).to_have_value("0.4242")
    page.unroute(f"**/episodes/{chosen}")


def test_cancelling_stops_the_llm_and_records_nothing(page, http, slow_provider):
    before = len(http.get("/predictions", params={"limit": 200}).json()["predictions"])
    page.goto("/ui/predict?task=pick")
    predict(page, SLOW)
    until(page, "document.querySelector('#reply').textContent.includes('], ')")
    page.get_by_role("button", name="Cancel").click()
    until(page, "document.querySelector('#state').innerText.startsWith('Cancelled')")
    slow_provider.go_on.set()
    assert slow_provider.hung_up.acquire(timeout=10)
    assert len(http.get("/predictions", params={"limit": 200}).json()["predictions"]) == before


def test_a_reply_that_is_no_list_of_actions_is_reported(page):
    page.expected_refusals = []
    page.goto("/ui/predict?task=pick")
    predict(page, "scripted")
    assert "not a list of valid actions" in state(page, "bad")
    page.get_by_text("The robot got no actions").wait_for()
    assert page.locator("#part-reply pre").inner_text() == "I would rather not move today."


def test_an_error_names_the_field(page):
    page.goto("/ui/predict?task=pick")
    quaternion = page.get_by_label("quaternion x y z w (may be empty)", exact=True)
    quaternion.fill("1 2 x")
    page.get_by_role("button", name="Show the prompt only").click()
    assert "objects[cube].quaternion_xyzw" in state(page, "bad")
    quaternion.fill("0 0 0 3")
    page.expected_refusals = [422, 422]
    page.get_by_role("button", name="Show the prompt only").click()
    until(page, "document.querySelector('#state').innerText.includes('unit')")
    quaternion.fill("")
    page.get_by_role("button", name="Show the prompt only").click()
    until(page, "document.querySelector('#state').innerText.includes('no LLM was asked')")
    assert page.locator("#prompt pre .action").count() == 4
    quaternion.fill("1 2 3 4")
    page.get_by_role("button", name="Show the prompt only").click()
    until(page, "document.querySelector('#state').innerText.includes('unit')")
    assert page.locator("#prompt").is_hidden(), "the prompt of an earlier request stands below the refusal"
    assert page.locator("#space-view").is_hidden()


def test_what_a_model_lacks_is_said(page):
    page.goto("/ui/predict?task=pick")
    page.get_by_text("cannot be asked here").click()
    assert "ROBOPROMPT_ANTHROPIC_API_KEY" in page.locator("#missing").inner_text()
    missing = page.locator("#model option", has_text="something is missing")
    assert missing.count() > 0
    assert all(missing.evaluate_all("options => options.map(option => option.disabled)"))


def test_a_prediction_is_tried_again_with_other_settings(page, seeded):
    page.goto(f"/ui/predictions/{seeded['failure']}")
    page.get_by_role("link", name="Try again").click()
    page.wait_for_url("**/ui/predict?again=*")
    assert page.get_by_label("x, m").input_value() == "0.5500"
    assert page.get_by_label("Model", exact=True).input_value() == "regression"
    page.get_by_label("Demonstrations", exact=True).fill("3")
    page.get_by_role("button", name="Show the prompt only").click()
    until(page, "document.querySelectorAll('#prompt pre .action').length === 3")


def scene(column):
    """Color, depth and mask of the camera of `tests.episodes` above a flat cube; its place."""
    depth_mm = np.full((48, 64), 300, np.uint16)
    mask = np.zeros((48, 64), np.uint16)
    mask[20:28, column : column + 8] = 7
    return {"rgb_front": picture(30), "depth_front": png(depth_mm), "mask_front": png(mask)}


@pytest.fixture(scope="module")
def masks_task(http):
    http.put("/tasks/masked", json={"pose_estimator": "masks"}).raise_for_status()
    for column in (10, 20, 30):
        document = metadata("masked", {}, cameras=[camera()]) | {"objects": [{"name": "cube", "mask_ids": [7]}]}
        parts = multipart(document, npz(**arrays(pick_trajectory((0.1, 0.0, 0.7)))), **scene(column))
        response = http.post("/episodes", files=parts)
        assert response.status_code == 201, response.text


def test_images_of_an_episode_are_asked_about(page, http, masks_task):
    page.goto("/ui/predict?task=masked")
    page.get_by_label("Images", exact=True).check()
    expect(page.locator("#chosen-images")).to_contain_text("rgb_front, depth_front, mask_front")
    predict(page, "regression")
    state(page, "good")
    (newest,) = http.get("/predictions", params={"task": "masked", "limit": 1}).json()["predictions"]
    assert (newest["cameras"], newest["objects"][0]["estimator"]) == (["front"], "masks")
    page.get_by_role("link", name="Open this prediction").click()
    page.locator(".cameras").scroll_into_view_if_needed()
    until(page, "[...document.querySelectorAll('.cameras img')].every(image => image.complete && image.naturalWidth)")
