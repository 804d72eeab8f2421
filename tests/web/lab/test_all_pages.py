"""What holds of every page."""

import pytest

PAGES = (
    "tasks",
    "tasks/pick",
    "tasks/pick/check",
    "episodes?task=pick",
    "episodes/{episode}?rule=uniform&interval=4",
    "episodes/{episode}/texts",
    "predict?task=pick",
    "predictions",
    "predictions?task=pick&outcome=success&model=scripted",
    "predictions/{failure}",
    "predictions/{refused}",
)


@pytest.mark.parametrize("address", PAGES)
@pytest.mark.parametrize(("scheme", "width"), [pytest.param("light", 1280, marks=pytest.mark.long), ("dark", 360)])
def test_it_can_be_read_by_everyone(page, http, seeded, check_accessibility, address, scheme, width):
    (episode,) = http.get("/episodes", params={"task": "pick", "limit": 1}).json()["episodes"]
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/ui/" + address.format(**seeded, episode=episode["id"]))
    check_accessibility(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.parametrize(
    ("address", "status", "said"),
    [
        ("nowhere", 404, "there is no page /ui/nowhere"),
        ("predictions/nope", 404, "there is no prediction 'nope'"),
        ("episodes/nope", 404, "there is no episode 'nope'"),
        ("predictions?cursor=-1", 422, "cursor"),
    ],
)
def test_wrong_addresses_and_values_are_reported(page, address, status, said):
    page.expected_refusals = [status]
    page.goto(f"/ui/{address}")
    assert said in page.get_by_role("alert").inner_text()
