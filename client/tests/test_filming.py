"""Cameras film a recording: in step with it, beside it, and never at its cost."""

import io
import json
import logging
import time

import cv2
import httpx
import numpy as np
import pytest
from arms import client_of
from test_recorder import SCENE, Guided

from roboprompt_client.cameras.picture import Intrinsics, Picture
from roboprompt_client.cameras.rig import MountedCamera
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.recording.journal import MARK, films_from_journal
from roboprompt_client.recording.recorder import Recorder
from roboprompt_client.recording.spool import JOURNAL, REFUSED, UNFINISHED, Spool
from roboprompt_client.types.film import MAX_PICTURE_PIXELS, Film, npz_from_film

INTRINSICS = Intrinsics(500, 500, 320, 240, 640, 480)


class Camera:
    """Sees the time in its pictures: as gray as tenths of a second have passed."""

    def __init__(self, breaks_after=None, shape=(48, 64), takes_s=0.0, other_shape=None, lag_s=0.0):
        self.began_s, self.left, self.shape, self.takes_s = time.monotonic(), breaks_after, shape, takes_s
        self.other_shape, self.lag_s, self.asked = other_shape, lag_s, 0

    def read(self):
        self.asked += 1
        if self.left is not None and self.asked > self.left:
            if self.other_shape is None:
                raise CameraError("was unplugged", "its cable")
            self.shape = self.other_shape
        time.sleep(self.takes_s)
        seen = min(250, int(100 * (time.monotonic() - self.began_s)))
        return Picture(np.full((*self.shape, 3), seen, np.uint8), None, INTRINSICS, time.time() - self.lag_s)

    def close(self):
        pass


def record(journal, *cameras, film_hz=20, seconds=0.5):
    mounted = [MountedCamera(name, camera) for name, camera in zip(("front", "wrist"), cameras, strict=False)]
    recorder = Recorder(Guided(), journal, 100, mounted, film_hz)
    recorder.start()
    time.sleep(seconds)
    return recorder.stop(), recorder.films


def gray(picture):
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    return float(image.mean())


def test_pictures_have_the_times_at_which_the_recording_saw_them(tmp_path):
    camera = Camera()
    trajectory, (front, wrist) = record(tmp_path / "journal", camera, Camera(takes_s=0.1))
    assert (front.camera, wrist.camera) == ("front", "wrist")
    assert 5 <= len(front.pictures) <= 11  # 20 Hz for half a second, on a busy machine
    assert 2 <= len(wrist.pictures) <= 5  # a slow camera has fewer
    for film in (front, wrist):
        assert film.times_s[0] >= trajectory.timestamps_s[0]
        assert film.times_s[-1] <= trajectory.timestamps_s[-1]
    heights_m = np.interp(front.times_s, trajectory.timestamps_s, trajectory.positions_m[:, 2])  # falls by 1 m/s
    seen = [gray(picture) for picture in front.pictures]
    assert np.ptp(np.array(seen) / 100 + heights_m) < 0.05


def test_a_camera_that_fails_ends_its_film_and_nothing_else(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        trajectory, films = record(tmp_path / "journal", Camera(breaks_after=3), Camera())
    assert len(films[0].pictures) == 3
    assert len(films[1].pictures) > 3
    assert len(trajectory) > 20
    assert [record.getMessage() for record in caplog.records] == [
        "the film of camera front ends here: was unplugged (its cable)"
    ]


@pytest.mark.parametrize(
    ("camera", "pictures", "said"),
    [
        (Camera(breaks_after=0), 0, "unplugged"),
        (Camera(breaks_after=2, other_shape=(64, 48)), 2, "changed their size"),
        (Camera(breaks_after=1, other_shape=(0, 64)), 1, "ends here"),
    ],
)
def test_what_ends_a_film(tmp_path, caplog, camera, pictures, said):
    trajectory, films = record(tmp_path / "journal", camera)
    assert sum(len(film.pictures) for film in films) == pictures
    assert said in caplog.text
    assert len(trajectory) > 20


def test_pictures_from_before_the_recording_are_left_out(tmp_path):
    assert record(tmp_path / "journal", Camera(lag_s=0.2))[1][0].times_s[0] >= 0
    assert record(tmp_path / "other", Camera(lag_s=60.0))[1] == ()


def test_large_pictures_are_made_smaller(tmp_path):
    (film,) = record(tmp_path / "journal", Camera(shape=(1500, 2000)), film_hz=5)[1]
    height_px, width_px, _ = cv2.imdecode(np.frombuffer(film.pictures[0], np.uint8), cv2.IMREAD_COLOR).shape
    assert (width_px, height_px) == (1000, 750)
    assert width_px * height_px <= MAX_PICTURE_PIXELS


def test_filming_does_not_slow_the_recording_down(tmp_path):
    """Pictures of 640x480 are encoded while the lock of Python is free."""
    rng = np.random.default_rng(0)

    class Detailed(Camera):
        def read(self):
            return Picture(rng.integers(0, 256, (480, 640, 3), np.uint8), None, INTRINSICS, time.time())

    alone = len(record(tmp_path / "alone", seconds=2)[0])
    filmed, (film,) = record(tmp_path / "filmed", Detailed(), film_hz=5, seconds=2)
    assert len(film.pictures) >= 6
    assert len(filmed) > 0.7 * alone


def test_a_rate_out_of_range_is_refused(tmp_path):
    assert record(tmp_path / "without", Camera(), film_hz=0, seconds=0.1)[1] == ()
    for rate_hz in (-1, 61, float("nan")):
        with pytest.raises(InvalidInputError, match="film_hz"):
            Recorder(Guided(), tmp_path / "journal", 100, [], rate_hz)


def test_a_crash_in_the_middle_of_a_picture_costs_that_picture(tmp_path):
    _, (film,) = record(tmp_path / "journal", Camera())
    path = tmp_path / f"journal{MARK}front"
    whole = path.read_bytes()
    end = whole.rindex(film.pictures[-1]) + len(film.pictures[-1])
    for cut in (1, len(film.pictures[-1]), len(film.pictures[-1]) + 5):
        path.write_bytes(whole[: end - cut])
        (left,) = films_from_journal(tmp_path / "journal")
        assert left.pictures == film.pictures[:-1]


def test_a_spooled_film_is_uploaded_with_its_recording(tmp_path):
    spool = Spool(tmp_path / "spool")
    folder = spool.new("pick", "pick up the cube", SCENE)
    _, (film,) = record(folder / UNFINISHED, Camera())
    assert not list(spool.waiting())
    spool.finish(folder)
    assert list(spool.waiting()) == [folder]
    sent = []

    def answer(request):
        sent.append(request.content)
        return httpx.Response(201, json={"id": "e1"})

    assert spool.send(client_of(answer), folder).stored
    assert b'name="film_front"; filename="film_front.npz"' in sent[0]
    assert npz_from_film(film) in sent[0]
    assert json.loads((folder / "sent.json").read_text()) == {"id": "e1"}
    spool.discard(folder)


def test_films_that_are_too_large_for_the_service_are_thinned_until_it_takes_the_recording(tmp_path, caplog):
    spool = Spool(tmp_path / "spool")
    folder = spool.new("pick", "pick up the cube", SCENE)
    _, (film,) = record(folder / JOURNAL, Camera(shape=(480, 640)), film_hz=40)
    sizes = []

    def takes(most):
        def answer(request):
            sizes.append(len(request.content))
            too_large = {"title": "The request is too large", "detail": f"at most {most} bytes"}
            return httpx.Response(413, json=too_large) if sizes[-1] > most else httpx.Response(201, json={"id": "e1"})

        return client_of(answer)

    assert not spool.send(takes(1000), folder).stored  # too large without its films, too
    smallest = sizes[-1]
    assert smallest > len(film.pictures[0])
    (folder / REFUSED).unlink()
    assert spool.send(takes(smallest + 3 * len(film.pictures[0])), folder).stored
    assert smallest < sizes[-1] <= smallest + 3 * len(film.pictures[0])
    assert "at most" in caplog.records[-1].getMessage()
    assert "again with one of 4 pictures of each film" in caplog.text


def test_a_link_in_the_place_of_a_film_is_not_uploaded(tmp_path):
    spool = Spool(tmp_path / "spool")
    folder = spool.new("pick", "pick up the cube", SCENE)
    record(folder / JOURNAL)
    (folder / f"{JOURNAL}{MARK}front").symlink_to("/etc/passwd")
    with pytest.raises(InvalidInputError, match="is a link"):
        spool.send(client_of(lambda request: httpx.Response(201, json={"id": "e1"})), folder)


def test_upload_sends_films():
    film = Film("side", np.array([0.0, 0.5]), (b"\xff\xd8\xff1\xff\xd9", b"\xff\xd8\xff22\xff\xd9"))
    with np.load(io.BytesIO(npz_from_film(film))) as arrays:
        assert arrays["timestamps"].tolist() == [0.0, 0.5]
        assert arrays["sizes"].tolist() == [6, 7]
        assert arrays["jpegs"].tobytes() == b"".join(film.pictures)
    with pytest.raises(InvalidInputError, match=r"film_side.timestamps.*increasing"):
        Film("side", np.array([0.5, 0.5]), film.pictures)
