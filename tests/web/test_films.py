"""What cameras took during a motion, beside the 3D view and in step with its player."""

import struct

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from app.web.play import film_bytes
from roboprompt_client.types.film import Film
from roboprompt_client.types.trajectory import Trajectory
from tests.episodes import arrays, film_npz, jpeg, metadata, multipart, npz, pick_trajectory
from tests.web.conftest import INSTRUCTION, PLACES_M

TIMES_S = [0.0, 0.2, 0.45, 0.8]


def test_pictures_lie_at_their_places_in_the_motion():
    trajectory = Trajectory.from_poses(np.zeros((3, 3)), np.tile([1.0, 0, 0, 0], (3, 1)), np.ones(3), [7.0, 7.5, 8.0])
    data = film_bytes(Film("front", [7.25, 8.0], (b"one", b"three")), trajectory)
    assert struct.unpack_from("<5f", data) == (2, 0.25, 1.0, 3, 5)
    assert data[20:] == b"onethree"


@pytest.fixture
def filmed(http):
    """Opens the page of an episode with these parts."""

    def upload(page, **films):
        document = metadata("filmed", {"cube": PLACES_M[0]}, INSTRUCTION)
        sent = multipart(document, npz(**arrays(pick_trajectory(PLACES_M[0]))), **films)
        page.goto(f"/ui/episodes/{http.post('/episodes', files=sent).raise_for_status().json()['id']}")
        page.locator(".player").wait_for()

    return upload


def seek(page, time_s):
    page.locator(".player input[type=range]").evaluate(
        "(bar, time_s) => { bar.value = time_s; bar.dispatchEvent(new Event('input', { bubbles: true })); }", time_s
    )


def gray(page, number):
    """How light the film's canvas is: its pictures are of one gray each."""
    script = "(canvas) => canvas.getContext('2d').getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data[0]"
    return page.locator("[data-film]").nth(number).evaluate(script)


def test_the_film_follows_the_timeline(page, filmed):
    filmed(page, film_front=film_npz(TIMES_S), film_side=film_npz([0.5], [jpeg(6, 32, 32)]))
    front, side = page.locator(".filmed figcaption").all()
    for time_s, number in ((0.0, 1), (0.44, 2), (0.45, 3), (1.0, 4), (0.1, 1)):
        seek(page, time_s)
        expect(front).to_contain_text(f"front, picture {number} of 4")
        assert gray(page, 0) == pytest.approx(40 * (number - 1), abs=2)
        expect(side).to_contain_text("side, picture 1 of 1")  # before its time it is shown, too
    assert gray(page, 1) == pytest.approx(240, abs=2)


def test_it_plays_and_downloads(page, filmed, url, check_accessibility):
    filmed(page, film_front=film_npz(TIMES_S))
    check_accessibility(page)
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.locator(".filmed figcaption")).to_contain_text("picture 4 of 4")
    address = page.get_by_role("link", name="film (.npz)").get_attribute("href")
    assert httpx.get(f"{url}{address}").content == film_npz(TIMES_S)


def test_a_picture_that_is_no_picture_is_said(page, filmed):
    damaged = b"\xff\xd8\xff" + jpeg()[3:180] + bytes(500) + b"\xff\xd9"
    filmed(page, film_front=film_npz([0.0, 0.5], [jpeg(1), damaged]))
    seek(page, 0.9)
    expect(page.locator(".filmed figcaption")).to_contain_text("picture 2 of 2 is damaged")
    seek(page, 0.0)
    expect(page.locator(".filmed figcaption")).to_contain_text("picture 1 of 2")
    assert gray(page, 0) == pytest.approx(40, abs=2)


def test_without_films_nothing_is_shown(page, filmed):
    filmed(page)
    assert page.locator(".filmed, [data-film]").count() == 0
