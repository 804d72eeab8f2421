"""The doubts about demonstrations: one list, wherever it is said."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from app.api.check_document import check_document
from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.services.predict.request import PredictRequest
from app.services.teach.upload_checks import Upload
from tests.pipeline.skill.shown import RATE_HZ, WORDS, drawn, stops_of, travelled

OF_SCENE_OR_ANSWER = ("unusual-scene", "new-instruction", "unusual-action", "passes-close", "uncertain-pose")


def queries(objects):
    return tuple(
        ObjectQuery(pose.name, tuple(pose.position_m.tolist()), tuple(pose.quaternion_xyzw.tolist()))
        for pose in objects
    )


def taught(services, change):
    random = np.random.default_rng(3)
    for _ in range(8):
        told, stops = change(*(lambda objects: (objects, stops_of(*objects)))(drawn(random)))
        episode = Episode(WORDS, travelled(stops), control_frequency_hz=RATE_HZ)
        services.upload_episode(Upload("tidy", episode, queries(told), {}))
    return drawn(random)


def exchanged(objects, stops):
    cup, coaster = objects
    return (replace(coaster, name="cup"), replace(cup, name="coaster")), stops


CASES = {
    "right": (lambda objects, stops: (objects, stops), set()),
    "gripper inverted": (lambda objects, stops: (objects, [(*pose, not o) for *pose, o in stops]), None),
    "always open": (lambda objects, stops: (objects, [(*pose, True) for *pose, _ in stops]), None),
    "two names exchanged": (exchanged, None),
}


@pytest.mark.parametrize("case", CASES)
def test_upload_check_prediction_and_page_say_the_same(nearest, case):
    change, _ = CASES[case]
    objects, _ = change(*(lambda of: (of, stops_of(*of)))(taught(nearest, change)))
    said = [finding.to_json() for finding in nearest.known.doubts("tidy")]  # of an upload, and on pages
    assert check_document(asyncio.run(nearest.check_task("tidy")))["findings"] == said
    request = PredictRequest("tidy", WORDS, queries(objects))
    answer = asyncio.run(nearest.predict_actions(request))
    findings = [one.to_json() for one in answer.findings]
    assert [one for one in findings if one["code"] not in OF_SCENE_OR_ANSWER] == said
    assert ("danger" in {one["severity"] for one in said}) == (case != "right")
