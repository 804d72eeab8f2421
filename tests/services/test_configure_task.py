import pytest
from pydantic import ValidationError

from app.store import tasks
from roboprompt_client.errors import InvalidInputError
from tests.services.test_upload_episode import upload


@pytest.fixture
def services(scripted):
    return scripted("[]")


def test_refused_settings_change_nothing(services):
    before = services.configure_task("pick", {})
    symmetries = ({"yaw_symmetry_deg": {"cube": degrees}} for degrees in (77, -90, 1e-320, 1e308))
    for wrong in ({"num_demonstrations": 0}, *symmetries):
        with pytest.raises(ValidationError):
            services.configure_task("pick", wrong)
    with services.store.read() as connection:
        assert tasks.get(connection, "pick") == before


RED = {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}


def test_models_are_kept_with_every_field(services):
    record = services.configure_task("pick", {"object_models": {"cube": RED}})
    kept = record.settings["object_models"]["cube"]
    assert (kept["size_m"], kept["shape"], kept["color"]["hue_deg"]) == (RED["size_m"], "box", [345, 14])
    assert services.configure_task("pick", {"object_models": {"cube": kept}}).version == record.version


def test_a_model_of_no_object_of_the_task_is_refused(services):
    services.upload_episode(upload("cube", "plate"))
    with pytest.raises(InvalidInputError, match=r"object_models\[bowl\].*valid: cube, plate"):
        services.configure_task("pick", {"object_models": {"bowl": RED}})


@pytest.mark.parametrize("url", ["http://x/poses", "not a url"])
def test_a_model_that_is_not_json_is_refused(services, url):
    remote = {"estimator": "remote", "url": url, "model": {"score": float("nan")}}
    with pytest.raises(ValidationError):
        services.configure_task("pick", {"object_models": {"cube": remote}})
