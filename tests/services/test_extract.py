"""What settings make out of date is extracted again when it is next read, and stored with the keys of the settings."""

import asyncio
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.images import ImageBytes, decode_frame
from app.services import extract
from app.services.extract import read_episode, read_episodes
from app.services.predict.request import PredictRequest
from app.services.teach.edit import edit_episode
from app.store import episodes
from app.store.errors import NotFoundError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import camera_from_json
from tests.episodes import camera, png
from tests.services.test_upload_episode import jointless, upload

EVERY_10TH = {"keyframes": {"rule": "uniform", "interval": 10}}
RED = {"object_models": {"cube": {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}}}
REQUEST = PredictRequest("pick", "pick up the cube", (ObjectQuery("cube", (0.2, 0.1, 0.8)),))


@pytest.fixture
def services(nearest):
    return nearest


def seen():
    """An upload with a camera's image and depth, and the object's pose beside them."""
    images = {"front": ImageBytes(png(np.zeros((48, 64, 3), np.uint8)), png(np.full((48, 64), 1000, np.uint16)))}
    frame = decode_frame(camera_from_json(camera()), images["front"])
    item = upload("cube")
    return replace(item, episode=replace(item.episode, frames=(frame,)), images=images)


def stored(services, id_):
    """The frames of the keyframes as they were extracted last."""
    with services.store.read() as connection:
        return [keyframe.index for keyframe in episodes.get(connection, id_).keyframes]


def read(services, id_, **how):
    return [keyframe.index for keyframe in read_episode(services.store, id_, **how)[0].keyframes]


def num_actions(services):
    return len(asyncio.run(services.predict_actions(REQUEST)).reply.actions)


def test_a_changed_rule_holds_for_what_is_read_next(services):
    id_ = services.upload_episode(upload("cube")).id
    before = stored(services, id_)
    services.configure_task("pick", EVERY_10TH)
    assert stored(services, id_) == before
    assert read(services, id_) == stored(services, id_) == [10, 20]
    services.configure_task("pick", {"keyframes": {"rule": "auto"}})
    with services.store.read() as connection:
        page = episodes.list_page(connection).items
    (listed,) = read_episodes(services.store, page)
    assert [keyframe.index for keyframe in listed[0].keyframes] == before


def test_predictions_and_checks_are_of_the_present_settings(services):
    ids = [services.upload_episode(upload("cube")).id for _ in range(3)]
    assert num_actions(services) == 3
    services.configure_task("pick", EVERY_10TH)
    assert num_actions(services) == 2
    assert all(stored(services, id_) == [10, 20] for id_ in ids)
    services.configure_task("pick", {"keyframes": {"interval": 5}})
    asyncio.run(services.check_task("pick"))
    assert all(stored(services, id_) == [5, 10, 15, 20] for id_ in ids)


def test_what_is_up_to_date_is_not_extracted_again(services, monkeypatch):
    id_ = services.upload_episode(seen()).id
    services.configure_task("pick", EVERY_10TH)
    monkeypatch.setattr(extract, "read_frame", None)  # images that no estimator looks at are not decoded
    assert read(services, id_) == [10, 20]
    monkeypatch.setattr(extract, "extract_again", None)
    services.configure_task("pick", {"num_demonstrations": 3})
    assert num_actions(services) == 2


def test_images_are_looked_at_with_the_present_models(services, monkeypatch):
    id_ = services.upload_episode(seen()).id
    services.configure_task("pick", RED)
    monkeypatch.setattr(extract, "keyframes_of", None)
    with pytest.raises(InvalidInputError, match=rf"episode {id_}: objects\[cube\]"):
        read(services, id_, strict=True)  # the picture is black
    services.configure_task("pick", {"object_models": {}})
    assert read_episode(services.store, id_)[0].objects[0].estimator == "given"


def test_a_model_leaves_given_poses_of_episodes_without_images(services):
    id_ = services.upload_episode(upload("cube")).id
    services.configure_task("pick", RED)
    assert read_episode(services.store, id_)[0].objects[0].estimator == "given"


def test_an_episode_that_cannot_be_extracted_is_named_by_what_needs_it(services):
    id_, kept = (services.upload_episode(item).id for item in (jointless(), upload("cube")))
    before = stored(services, id_)
    services.configure_task("pick", {"keyframes": {"rule": "merged"}})
    for use in (lambda: read(services, id_, strict=True), lambda: num_actions(services)):
        with pytest.raises(InvalidInputError, match=rf"episode {id_}: trajectory\.joint_velocities: is missing"):
            use()
    assert read(services, id_) == before  # as it was
    assert read(services, kept, strict=True)
    services.upload_episode(upload("cube"))  # teaching goes on
    services.configure_task("pick", {"keyframes": {"rule": "auto"}})
    edit_episode(services.store, id_, {"left_out": True})
    services.configure_task("pick", {"keyframes": {"rule": "merged"}})
    assert num_actions(services) == 3
    assert read(services, id_, strict=True) == before
    with pytest.raises(InvalidInputError, match=id_):
        edit_episode(services.store, id_, {"left_out": False})


def test_settings_that_change_meanwhile_win(services, monkeypatch):
    id_ = services.upload_episode(upload("cube")).id
    services.configure_task("pick", EVERY_10TH)
    extract_again = extract.extract_again

    def slowly(*arguments):
        monkeypatch.setattr(extract, "extract_again", extract_again)
        extraction = extract_again(*arguments)
        services.configure_task("pick", {"keyframes": {"interval": 5}})
        assert read(services, id_) == [5, 10, 15, 20]
        return extraction

    monkeypatch.setattr(extract, "extract_again", slowly)
    assert read(services, id_) == stored(services, id_) == [5, 10, 15, 20]


def test_an_episode_that_is_deleted_meanwhile_is_no_error(services, monkeypatch):
    gone, _ = (services.upload_episode(upload("cube")).id for _ in range(2))
    services.configure_task("pick", EVERY_10TH)
    extract_again = extract.extract_again

    def without(store, record, settings):
        with suppress(NotFoundError), store.write() as connection:
            episodes.remove(connection, gone)
        return extract_again(store, record, settings)

    monkeypatch.setattr(extract, "extract_again", without)
    assert num_actions(services) == 2
