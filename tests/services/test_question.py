"""What happens while images are looked at."""

import asyncio

import pytest

from app.perception.base import ObjectQuery
from app.services.predict import known
from app.services.predict.request import PredictRequest
from app.store.errors import ConflictError
from roboprompt_client.types.camera import Camera, RgbdFrame
from tests.services.test_upload_episode import upload

FRAME = RgbdFrame(Camera("front", 60, 60, 31.5, 23.5, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
SEEN = PredictRequest("pick", "pick up the cube", (ObjectQuery("cube", (0.2, 0.1, 0.8)),), (FRAME,))


@pytest.fixture
def services(scripted):
    services = scripted("[]")
    services.upload_episode(upload("cube"))
    return services


def looking(monkeypatch, meanwhile):
    """Let something happen whenever poses are estimated."""
    estimate = known.poses_of

    def estimate_slowly(*arguments, **options):
        meanwhile()
        return estimate(*arguments, **options)

    monkeypatch.setattr(known, "poses_of", estimate_slowly)


def prepare(services, request):
    return asyncio.run(services.predict_actions.prepare(request))


def test_no_transaction_waits_for_images(services, monkeypatch):
    looking(monkeypatch, lambda: services.upload_episode(upload("cube")))
    assert len(prepare(services, SEEN).prefix.demonstration_ids) == 2


def test_settings_that_change_meanwhile_are_a_conflict(services, monkeypatch):
    looking(monkeypatch, lambda: services.configure_task("pick", {"yaw_symmetry_deg": {"cube": 90}}))
    with pytest.raises(ConflictError, match="send the request again"):
        prepare(services, SEEN)
