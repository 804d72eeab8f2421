from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from app.perception.images import ImageBytes, decode_frame
from app.services.teach import configure, extract
from app.services.teach.edit import remove_episode
from app.store import episodes
from app.store.errors import ConflictError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import camera_from_json
from tests.episodes import camera, png
from tests.services.test_upload_episode import jointless, respond, upload


@pytest.fixture
def services(scripted):
    return scripted("[]")


def seen(name):
    """An upload with a camera's image and depth, and the object's pose beside them."""
    images = {"front": ImageBytes(png(np.zeros((48, 64, 3), np.uint8)), png(np.full((48, 64), 1000, np.uint16)))}
    frame = decode_frame(camera_from_json(camera()), images["front"])
    item = upload(name)
    return replace(item, episode=replace(item.episode, frames=(frame,)), images=images)


def keyframes(services, id_):
    with services.store.read() as connection:
        return [keyframe.index for keyframe in episodes.get(connection, id_).keyframes]


def test_an_upload_in_between_is_not_lost(services, monkeypatch):
    """An episode that arrives while others are extracted again would keep the old rule's keyframes."""
    services.upload_episode(upload("cube"), respond)
    extract_all = configure.extract_all_again

    def extract_slowly(store, records, settings):
        services.upload_episode(upload("cube"), respond)
        return extract_all(store, records, settings)

    monkeypatch.setattr(configure, "extract_all_again", extract_slowly)
    with pytest.raises(ConflictError):
        services.configure_task("pick", {"keyframes": {"rule": "uniform", "interval": 10}})


def test_a_deletion_in_between_is_a_conflict(services, monkeypatch):
    ids = [services.upload_episode(upload("cube"), respond)["id"] for _ in range(2)]
    extract_all = configure.extract_all_again

    def extract_what_is_gone(store, records, settings):
        remove_episode(store, ids[0])
        return extract_all(store, records, settings)

    monkeypatch.setattr(configure, "extract_all_again", extract_what_is_gone)
    with pytest.raises(ConflictError, match="read it again"):
        services.configure_task("pick", {"keyframes": {"rule": "uniform", "interval": 10}})


def test_images_that_no_estimator_looks_at_are_not_decoded(services, monkeypatch):
    ids = [services.upload_episode(seen("cube"), respond)["id"] for _ in range(2)]
    monkeypatch.setattr(extract, "read_frame", None)
    services.configure_task("pick", {"keyframes": {"rule": "uniform", "interval": 10}})
    assert all(keyframes(services, id_) == [10, 20] for id_ in ids)


def test_refused_settings_change_nothing(services):
    id_ = services.upload_episode(jointless(), respond)["id"]
    before = keyframes(services, id_)
    with pytest.raises(InvalidInputError, match=id_):
        services.configure_task("pick", {"keyframes": {"rule": "merged"}})
    symmetries = ({"yaw_symmetry_deg": {"cube": degrees}} for degrees in (77, -90, 1e-320, 1e308))
    for wrong in ({"num_demonstrations": 0}, *symmetries):
        with pytest.raises(ValidationError):
            services.configure_task("pick", wrong)
    assert keyframes(services, id_) == before


RED = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}


def test_models_are_kept_with_every_field(services):
    record = services.configure_task("pick", {"object_models": {"cube": RED}})
    kept = record.settings["object_models"]["cube"]
    assert (kept["size_m"], kept["shape"], kept["color"]["hue_deg"]) == (RED["size_m"], "box", [345, 14])
    assert services.configure_task("pick", {"object_models": {"cube": kept}}).version == record.version


def test_a_model_leaves_given_poses_of_episodes_without_images(services):
    id_ = services.upload_episode(upload("cube"), respond)["id"]
    services.configure_task("pick", {"object_models": {"cube": RED}})
    with services.store.read() as connection:
        (cube,) = episodes.get(connection, id_).objects
    assert cube.estimator == "given"


def test_a_model_of_no_object_of_the_task_is_refused(services):
    services.upload_episode(upload("cube", "plate"), respond)
    with pytest.raises(InvalidInputError, match=r"object_models\[bowl\].*valid: cube, plate"):
        services.configure_task("pick", {"object_models": {"bowl": RED}})


@pytest.mark.parametrize("url", ["http://x/poses", "not a url"])
def test_a_model_that_is_not_json_is_refused(services, url):
    remote = {"estimator": "remote", "url": url, "model": {"score": float("nan")}}
    with pytest.raises(ValidationError):
        services.configure_task("pick", {"object_models": {"cube": remote}})
