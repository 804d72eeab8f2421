"""What cameras took during a motion: uploaded, given back, exported, deleted; and films that are refused."""

import base64

import cv2
import numpy as np
import pytest

from app.cli.export_data import download
from roboprompt_client import RoboPromptClient
from tests.episodes import arrays, film_npz, jpeg, metadata, multipart, npz, pick_trajectory, png, refused

PLACE_M = (0.123, 0.077, 0.785)
TIMES_S = [0.0, 0.2, 0.45, 1.0]  # of 21 frames at 20 Hz, which end at 1.0 s
TRAJECTORY = arrays(pick_trajectory(PLACE_M))


def post(http, task, recorded=TRAJECTORY, **films):
    return http.post("/episodes", files=multipart(metadata(task, {"cube": PLACE_M}), npz(**recorded), **films))


def test_films_come_back_whole_and_picture_by_picture(http):
    front, side = film_npz(TIMES_S), film_npz([0.5], [jpeg(7, 32, 32)])
    answer = post(http, "filmed", film_side=side, film_front=front)
    assert answer.status_code == 201, answer.text
    episode = answer.json()
    assert episode["films"] == ["front", "side"]  # of cameras that are not calibrated
    address = f"/episodes/{episode['id']}"
    assert http.get(address).json()["films"] == ["front", "side"]
    assert [http.get(f"{address}/films/{name}").content for name in ("front", "side")] == [front, side]
    disposition = http.get(f"{address}/films/side").headers["content-disposition"]
    assert disposition == 'attachment; filename="film_side.npz"'  # by its part's name it can be uploaded again
    for number in range(len(TIMES_S)):
        picture = http.get(f"{address}/films/front/{number}")
        assert (picture.headers["content-type"], picture.content) == ("image/jpeg", jpeg(number))
    for missing in ("front/4", "back", "back/0"):
        assert http.get(f"{address}/films/{missing}").status_code == 404
    refused(http.get(f"{address}/films/front/-1"), "number")
    assert post(http, "filmed").json()["films"] == []
    assert http.delete(address).status_code == 204
    assert http.get(f"{address}/films/front").status_code == 404


def test_json_takes_films_in_base64(http):
    document = metadata("inline", {"cube": PLACE_M})
    recorded = {name: np.asarray(array, float).tolist() for name, array in TRAJECTORY.items()}
    film = film_npz(TIMES_S)
    sent = {"metadata": document, "trajectory": recorded, "film_front": base64.b64encode(film).decode()}
    id_ = http.post("/episodes", json=sent).raise_for_status().json()["id"]
    assert http.get(f"/episodes/{id_}/films/front").content == film


def test_an_export_has_the_films(http, url):
    film = film_npz(TIMES_S)
    id_ = post(http, "travelling", film_front=film).json()["id"]
    with RoboPromptClient(url) as client:
        (parcel,) = download(client, [id_])
    assert parcel.files["film_front"] == film


def test_times_are_by_the_clock_of_the_trajectory(http):
    clocked = {**TRAJECTORY, "timestamps": 1000 + np.arange(21) / 20}
    assert post(http, "clocked", clocked, film_front=film_npz([1000.0, 1001.0])).status_code == 201
    refused(post(http, "clocked", clocked, film_front=film_npz([0.0, 1.0])), "film_front.timestamps", "1000 to 1001 s")


def huge_jpeg():
    """Whose header claims 4000 x 3000 pixels."""
    data = bytearray(jpeg())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = (3000).to_bytes(2, "big") + (4000).to_bytes(2, "big")
    return bytes(data)


PNG = png(np.zeros((48, 64, 3), np.uint8))
FIRST = [jpeg()]
REFUSED = {
    "no file": (b"", "film_front", "timestamps (N,) s"),
    "no npz": (b"junk", "film_front", "not a readable .npz"),
    "an array is missing": (film_npz([0.0], sizes=None), "film_front.sizes", "is missing"),
    "an array is unknown": (film_npz([0.0], sizes=None, lengths=np.ones(1)), "film_front.lengths", "not known"),
    "four arrays": (film_npz([0.0], rgb=np.ones(1)), "film_front", "4 arrays"),
    "more than it may unpack to": (film_npz([0.0], jpegs=np.zeros(70_000_000, np.uint8)), "film_front", "unpacks to"),
    "no picture": (film_npz([]), "film_front", "1 to 3000"),
    "too many pictures": (film_npz(np.arange(3001) / 3001, [b"x"] * 3001), "film_front.sizes", "at most 3000"),
    "a picture without bytes": (film_npz([0.0, 0.1], [jpeg(), b""]), "film_front.sizes", "below 1"),
    "sizes that do not sum up": (film_npz([0.0], sizes=np.array([9])), "film_front.jpegs", "uint8 of shape (9,)"),
    "sizes that overflow": (film_npz([0.0], sizes=np.array([2**63 - 1])), "film_front.jpegs", "uint8 of shape"),
    "one time too many": (film_npz([0.0, 0.1], FIRST), "film_front.timestamps", "shape (2,)"),
    "times that do not increase": (film_npz([0.1, 0.1]), "film_front.timestamps", "increasing seconds"),
    "a time that is no number": (film_npz([np.nan]), "film_front.timestamps", "finite"),
    "after the recording": (film_npz([0.9, 1.05]), "film_front.timestamps", "0 to 1 s"),
    "before the recording": (film_npz([-0.1]), "film_front.timestamps", "0 to 1 s"),
    "a PNG": (film_npz([0.0], [PNG]), "film_front.jpegs[0]", "a whole JPEG file"),
    "the second cut off": (film_npz([0.0, 0.1], [jpeg(), jpeg()[:-2]]), "film_front.jpegs[1]", "a whole JPEG file"),
    "too many pixels": (film_npz([0.0], [huge_jpeg()]), "film_front.jpegs[0]", "1 to 2304000 pixels"),
    "too many scans": (film_npz([0.0], [jpeg()[:-2] + b"\xff\xda" * 19 + b"\xff\xd9"]), "film_front.jpegs[0]", "18"),
    "two sizes": (film_npz([0.0, 0.1], [jpeg(), jpeg(1, 48, 64)]), "film_front.jpegs[1]", "one size"),
    "a large picture": (film_npz([0.0], [jpeg()[:-2] + bytes(10**6) + b"\xff\xd9"]), "film_front.sizes", "1000000"),
}


@pytest.mark.parametrize(("film", "field", "words"), REFUSED.values(), ids=REFUSED)
def test_films_are_refused_for_what_is_wrong(http, film, field, words):
    refused(post(http, "unfilmed", film_front=film), field, words)
    assert http.get("/tasks/unfilmed").status_code == 404


def test_a_films_name_is_a_cameras(http):
    refused(post(http, "unfilmed", **{"film_../x": film_npz([0.0])}), "film", "letters, digits")


def test_predictions_take_no_films(http):
    post(http, "unasked").raise_for_status()
    document = metadata("unasked", {"cube": PLACE_M}, dry_run=True)
    refused(http.post("/predict", files=multipart(document, None, film_front=film_npz([0.0]))), "film_front")


def test_pictures_are_as_browsers_show_them(http):
    id_ = post(http, "shown", film_front=film_npz([0.0, 0.5])).json()["id"]
    data = http.get(f"/episodes/{id_}/films/front/1").content
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape == (48, 64, 3)
