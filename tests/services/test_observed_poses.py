"""An answer and its record have the objects' poses as the robot sent them, also where a symmetry turns them inside."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.api.documents import prediction_document
from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.services.predict.request import PredictRequest
from app.services.teach.upload_checks import Upload
from app.store import predictions
from app.web.prediction_views import view_prediction

from ..pipeline.recordings import DOWN, arrival_s, pick_and_place, resting

UP_M = np.array([0, 0, 0.12])
YAWS_DEG = np.linspace(-170, 175, 12)
SEEN_DEG = 100.0


def about_z(yaw_deg):
    return Rotation.from_euler("z", yaw_deg, degrees=True)


def cube(place_m, yaw_deg):
    return (ObjectQuery("cube", tuple(place_m), tuple(about_z(yaw_deg).as_quat())),)


def lifted(place_m, yaw_deg):
    """A cube that a hand takes by the side nearest to it."""
    motion = pick_and_place(place_m, place_m + 0.2, move=resting, start_m=(0.2, 0.0, 0.5))
    end_s = arrival_s(motion, place_m + UP_M, 2) + 0.4
    recorded = replace(motion, knots=tuple(knot for knot in motion.knots if knot[0] <= end_s)).at(20)
    hand = about_z((yaw_deg + 45) % 90 - 45) * DOWN
    trajectory = replace(recorded, quaternions_xyzw=np.tile(hand.as_quat(), (len(recorded), 1)))
    return Upload("lift", Episode("lift the cube", trajectory), cube(place_m, yaw_deg), {})


@pytest.mark.parametrize("settings", [{}, {"yaw_symmetry_deg": {"cube": 90}}])
def test_symmetric_objects_are_answered_and_stored_as_they_were_observed(nearest, settings):
    random = np.random.default_rng(5)
    for yaw_deg in YAWS_DEG:
        nearest.upload_episode(lifted(random.uniform([0.25, -0.3, 0.02], [0.5, 0.3, 0.02]), yaw_deg))
    nearest.configure_task("lift", settings)
    sent = cube((0.35, -0.1, 0.02), SEEN_DEG)
    prediction = asyncio.run(nearest.predict_actions(PredictRequest("lift", "lift the cube", sent)))

    (turned,) = prediction.reply.question.parts[0].objects
    yaw_deg = Rotation.from_quat(turned.quaternion_xyzw).as_euler("zyx", degrees=True)[0]
    assert round((yaw_deg - SEEN_DEG) % 360, 6) in (90, 180, 270)  # one of the sides that look the same
    (answered,) = prediction_document(prediction)["objects"]
    with nearest.store.read() as connection:
        record = predictions.get(connection, prediction.id)
    off = view_prediction(nearest.store, nearest.known, prediction.id).off
    for position_m, quaternion in (
        (answered["position"], answered["quaternion_xyzw"]),
        (record.objects[0].position_m, record.objects[0].quaternion_xyzw),
    ):
        assert np.allclose(position_m, sent[0].position_m)
        assert np.allclose(quaternion, sent[0].quaternion_xyzw)
    assert max(item.off_deg for item in off) < 10  # compared as demonstrations have it
