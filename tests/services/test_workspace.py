"""The workspace is what the present demonstrations span: no upload moves it far, a deletion takes it back."""

import pytest

from app.services.teach.edit import remove_episode
from app.store import tasks
from tests.services.test_upload_episode import respond, upload

NEAR_M, ASIDE_M, FAR_M = (0.1, 0.1, 0.78), (0.4, 0.3, 0.78), (2.5, 2.5, 0.78)


def answering(record, settings):
    return {**respond(record, settings), "max": list(settings.workspace.max)}


@pytest.fixture
def services(scripted):
    return scripted("[]")


@pytest.fixture
def sent(services):
    def send(place_m, number=1):
        return [services.upload_episode(upload("cube", place_m=place_m), answering) for _ in range(number)][-1]

    return send


def box(services):
    with services.store.read() as connection:
        return tasks.get(connection, "pick").settings["workspace"]


def codes(answer):
    return [finding["code"] for finding in answer["findings"]]


def test_one_upload_far_from_the_others_moves_no_bound_and_has_a_finding(services, sent):
    sent(NEAR_M, 3)
    before = box(services)
    answer = sent(FAR_M)
    assert (box(services), answer["max"]) == (before, before["max"])
    finding = next(finding for finding in answer["findings"] if finding["code"] == "beyond-workspace")
    assert finding["severity"] == "warning"
    assert finding["wanted_edge_m"] > 2 * finding["edge_m"]
    assert '"auto"' in finding["message"]


@pytest.mark.parametrize("odd", range(3))
def test_one_of_the_first_three_far_from_both_others_moves_no_bound(services, sent, odd):
    places = [NEAR_M, ASIDE_M]
    places.insert(odd, FAR_M)
    answers = [sent(place) for place in places]
    assert box(services)["max"][0] < 1.5
    (finding,) = [f for f in answers[-1]["findings"] if f["code"] == "beyond-workspace"]
    assert ("The recording" if odd == 2 else answers[odd]["id"]) in finding["message"]
    sent(NEAR_M)
    assert box(services)["max"][0] < 1.5


def test_of_three_far_apart_none_is_the_odd_one(services, sent):
    for place in (NEAR_M, (2.5, 0.1, 0.78), (0.1, 2.5, 0.78)):
        sent(place)
    assert box(services)["max"][:2] == pytest.approx([2.6, 2.6], abs=0.2)


def test_many_small_steps_reach_no_farther(services, sent):
    sent(NEAR_M, 3)
    for step in range(13):
        sent((0.1 + step * 0.2, 0.1, 0.78))
    assert box(services)["max"][0] - box(services)["min"][0] <= 2.4


def test_a_key_that_may_configure_accepts_it_and_it_stays(services, sent):
    sent(NEAR_M, 3)
    sent(FAR_M)
    services.configure_task("pick", {"workspace": {"preset": "auto"}})
    assert box(services)["max"][0] > 2.5
    assert codes(sent(FAR_M)).count("beyond-workspace") == 0
    remove_episode(services.store, sent(NEAR_M)["id"])
    assert box(services)["max"][0] > 2.5


@pytest.mark.parametrize("changes", [{"keyframes": {"rule": "waypoints"}}, {"num_demonstrations": 4}])
def test_other_settings_accept_nothing(services, sent, changes):
    sent(NEAR_M, 3)
    sent(FAR_M)
    services.configure_task("pick", changes)
    assert box(services)["max"][0] < 1.5


def test_a_deletion_takes_the_room_back(services, sent):
    sent(NEAR_M)
    before = box(services)
    wide = sent((1.2, 0.1, 0.78))
    assert box(services)["max"][0] > before["max"][0]
    remove_episode(services.store, wide["id"])
    assert box(services) == before


def test_a_deletion_lets_in_none_that_waits(services, sent):
    ids = [sent(NEAR_M)["id"] for _ in range(3)]
    sent(FAR_M)
    for id_ in ids:
        remove_episode(services.store, id_)
    assert box(services)["max"][0] < 1.5


def test_a_box_of_ones_own_follows_no_demonstration(services, sent):
    own = {"min": [0.0, -0.5, 0.6], "max": [0.7, 0.5, 1.6]}
    services.configure_task("pick", {"workspace": own})
    answer = sent(FAR_M)
    assert codes(answer).count("beyond-workspace") == 0
    remove_episode(services.store, answer["id"])
    assert box(services) == {"preset": None, **own}
