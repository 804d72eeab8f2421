import numpy as np

from app.pipeline.order.order import Order
from app.pipeline.skill.script import Event, Expected, expected, faults, matched
from tests.pipeline.skill.shown import recordings

NAMES = ("cup", "plate", "bowl")


def at(opens, name):
    return Event(opens, 0, np.array([0.02 if name == other else 0.4 for other in NAMES]))


def asked(text):
    return [(one.opens, one.objects) for one in expected(Order(text, NAMES))]


def test_words_ask_for_a_grasp_and_a_release():
    assert asked("put the cup on the plate") == [(False, ("cup",)), (True, ("plate",))]
    assert asked("pick up the cup") == [(False, ("cup",))]
    assert asked("push the cup") == []


def test_clauses_ask_for_events_in_their_order():
    wanted = asked("put the cup on the plate, then put the bowl on the cup")
    assert [objects for _, objects in wanted] == [("cup",), ("plate",), ("bowl",), ("cup",)]


def test_what_happens_as_asked_costs_nothing():
    wanted = expected(Order("put the cup on the plate", NAMES))
    nats, pairs = matched(wanted, [at(False, "cup"), at(True, "plate")], NAMES)
    assert nats == 0
    assert pairs == [0, 1]


def test_a_second_try_costs_nothing():
    wanted = expected(Order("put the cup on the plate", NAMES))
    nats, pairs = matched(wanted, [at(False, "cup"), at(True, "cup"), at(False, "cup"), at(True, "plate")], NAMES)
    assert nats == 0
    assert pairs[1] == 3


def test_another_goal_another_order_and_what_is_missing_cost():
    wanted = expected(Order("put the cup on the plate", NAMES))
    for found in ([at(False, "cup"), at(True, "bowl")], [at(True, "plate"), at(False, "cup")], []):
        assert matched(wanted, found, NAMES)[0] <= -3


def test_an_event_anywhere_fits_where_words_name_no_object():
    assert matched([Expected(False, ())], [at(False, "bowl")], NAMES)[0] == 0


def test_right_recordings_have_no_faults_and_inverted_ones_have():
    (item,) = recordings(1)
    assert faults(item) == []
    assert sum(fault.nats for fault in faults(item, inverted=True)) <= -5
