"""An object is shown by clicks in a simulated episode's pictures, learned, and found in the others."""

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.e2e.test_labels import GIVEN, PLACES, ROOM, layout, shots
from tests.e2e.vision import episode


@pytest.fixture(scope="module")
def shelf(http):
    """Three episodes with pictures, and one without; the newest first."""
    ids = []
    for number, (carton, jar) in enumerate(PLACES):
        views = shots(layout(carton, jar), number)
        answer = http.post("/episodes", files=episode("shelf", views, objects=GIVEN))
        assert answer.status_code == 201, answer.text
        ids.append(answer.json()["id"])
    yield ids[::-1]
    http.delete("/tasks/shelf")


@pytest.fixture
def marking(page, shelf):
    page.goto(f"/ui/episodes/{shelf[-1]}/object?name=carton")
    expect(page.locator("svg.marking image")).to_have_count(3)
    return page


CARTON_M = (*PLACES[0][0][:2], 0.09)
JAR_M = (*PLACES[0][1], 0.1)


def on_screen(page, place_m):
    """Where the first camera's picture shows a place."""
    ((u, v),), _ = ROOM.calibrated[0].project([place_m])
    box = page.locator("svg.marking").first.bounding_box()
    return box["x"] + u * box["width"] / 640, box["y"] + v * box["height"] / 480


def click(page, place_m):
    page.locator("svg.marking").first.scroll_into_view_if_needed()
    page.mouse.click(*on_screen(page, place_m))


def num_pixels(page):
    """Of the masks, by camera."""
    expect(page.get_by_role("button", name="Keep this label")).to_be_enabled()
    return [int(text.split()[1]) for text in page.locator("figcaption .count").all_inner_texts()]


def test_clicks_add_and_take_away_a_drag_is_a_box_and_an_arrow_a_yaw(marking):
    page = marking
    click(page, CARTON_M)
    carton = num_pixels(page)
    assert min(carton) > 1000
    click(page, JAR_M)
    expect(page.locator(".count").first).not_to_contain_text(str(carton[0]))
    assert min(np.subtract(num_pixels(page), carton)) > 500
    page.get_by_label("takes away").check()
    click(page, JAR_M)
    expect(page.locator(".count").first).to_contain_text(str(carton[0]))
    page.get_by_role("button", name="Start again").click()
    page.get_by_label("adds to").check()
    x, y = on_screen(page, CARTON_M)
    page.mouse.move(x - 40, y - 40)
    page.mouse.down()
    page.mouse.move(x + 40, y + 50, steps=3)
    page.mouse.up()
    assert num_pixels(page)[0] == pytest.approx(carton[0], rel=0.1)
    page.get_by_label("draws an arrow").check()
    page.mouse.move(*on_screen(page, CARTON_M))
    page.mouse.down()
    page.mouse.move(*on_screen(page, (CARTON_M[0], CARTON_M[1] + 0.08, CARTON_M[2])), steps=3)
    page.mouse.up()
    expect(page.locator("#state")).to_contain_text("Its x axis points")
    yaw_deg = float(page.locator("#state").inner_text().split("points ")[1].split()[0])
    assert yaw_deg == pytest.approx(90, abs=10)
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("#state")).not_to_contain_text("Its x axis points")


def test_it_works_by_keyboard_from_a_mark_to_what_is_found_in_the_task(marking, shelf, http):
    page = marking
    expect(page.locator("#enough")).to_have_text(
        "carton: 0 labeled episodes; one is enough to try, three are to rely on."
    )
    picture = page.locator("svg.marking").first
    picture.focus()
    ((u, v),), _ = ROOM.calibrated[0].project([CARTON_M])
    for count, forth, back in ((u - 320, "ArrowRight", "ArrowLeft"), (v - 240, "ArrowDown", "ArrowUp")):
        for _ in range(round(abs(count) / 8)):
            picture.press(forth if count > 0 else back)
    picture.press("Enter")
    assert min(num_pixels(page)) > 1000
    page.get_by_role("button", name="Keep this label").press("Enter")
    expect(page.locator("#enough")).to_contain_text("carton: 1 labeled episode; one is enough to try")
    expect(page.locator("#labels li")).to_have_count(1)
    page.get_by_role("button", name="Try it on every").press("Enter")
    expect(page.locator("#progress")).to_have_text("3 of 3 episodes: 3 found")
    assert [row.split("\t")[1] for row in page.locator("#rows tbody tr").all_inner_texts()] == ["found"] * 3
    assert http.get("/tasks/shelf").json()["object_models"] == {}
    page.get_by_role("button", name="Use it in the task").press("Enter")
    expect(page.locator("#learned")).to_contain_text("every episode was extracted again")
    assert http.get(f"/episodes/{shelf[0]}").json()["objects"][0]["estimator"] == "registered"
    page.goto("/ui/tasks/shelf")
    expect(page.get_by_role("table", name="How objects are found").get_by_role("row", name="carton")).to_contain_text(
        "registered, learned from 1 view"
    )
    page.get_by_role("row", name="jar").get_by_role("link").click()
    expect(page.get_by_label("Object", exact=True)).to_have_value("jar")


@pytest.mark.parametrize(("width", "colors"), [(1280, "light"), (390, "dark")])
def test_everyone_can_read_it(marking, check_accessibility, width, colors):
    marking.emulate_media(color_scheme=colors)
    marking.set_viewport_size({"width": width, "height": 800})
    click(marking, CARTON_M)
    num_pixels(marking)
    check_accessibility(marking)
    assert marking.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_an_episode_without_pictures_says_so(page, seeded):
    page.goto(f"/ui/episodes/{seeded[0]['id']}/object")
    expect(page.locator("main")).to_contain_text("no camera with color and depth")
