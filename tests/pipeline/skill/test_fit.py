from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.skill import turns
from app.pipeline.skill.skill import fit
from tests.pipeline.skill.shown import HOME_M, drawn, home, moved, posed, recordings, scene, stops_of

NEW = drawn(np.random.default_rng(99))
EXPECTED = stops_of(*NEW)[1:]


def off(actions, stops):
    places = max(np.linalg.norm(a.position_m - place) for a, (place, _, _) in zip(actions, stops, strict=True))
    hands = max(float(turns.angle(a.quaternion_xyzw, hand)) for a, (_, hand, _) in zip(actions, stops, strict=True))
    return places, hands


@pytest.fixture(scope="module")
def skill():
    return fit(recordings())


def test_in_a_new_scene_the_hand_goes_where_a_demonstration_would(skill):
    actions = skill.plan_for(scene(NEW)).at(scene(NEW))
    place_m, turn_rad = off(actions, EXPECTED)
    assert place_m < 1e-6
    assert turn_rad < 1e-5
    assert [a.gripper_open for a in actions] == [is_open for _, _, is_open in EXPECTED]


def test_rows_follow_the_cup_until_it_is_carried_and_then_the_coaster(skill):
    follows = [set(row.frame.objects) for row in skill.plans[0].rows]
    assert follows == [{"<0>"}] * 3 + [{"<1>"}] * 3


@pytest.mark.parametrize("number", [1, 2, 3])
def test_few_demonstrations_are_enough_where_they_are_exact(number):
    actions = fit(recordings(number)).plans[0].at(scene(NEW))
    place_m, _ = off(actions, EXPECTED)
    assert place_m < 1e-6


def test_the_order_of_demonstrations_does_not_matter(skill):
    other = fit(recordings()[::-1])
    assert [row.frame for row in other.plans[0].rows] == [row.frame for row in skill.plans[0].rows]
    for one, same in zip(skill.plans[0].rows, other.plans[0].rows, strict=True):
        np.testing.assert_allclose(one.place, same.place, atol=1e-9)
        assert one.log_evidence == pytest.approx(same.log_evidence)


def test_a_world_that_is_turned_and_shifted_turns_and_shifts_the_answer():
    place_m, turn = np.array([0.4, -0.2, 0.1]), turns.about_z(0.7)

    def in_other_world(number, objects, stops):
        there = [(turns.rotated(turn, p) + place_m, turns.product(turn, q), o) for p, q, o in stops]
        return moved(objects, place_m, turn), there

    plan = fit(recordings(change=in_other_world)).plans[0]
    there = moved(NEW, place_m, turn)
    start = home(turns.rotated(turn, HOME_M) + place_m, turns.product(turn, home().quaternion_xyzw))
    expected = in_other_world(0, NEW, EXPECTED)[1]
    assert off(plan.at(scene(there, start)), expected)[0] < 1e-6


def test_a_demonstration_elsewhere_does_not_move_the_mean():
    def one_is_off(number, objects, stops):
        return objects, [(p + (number == 3) * np.array([0.0, 0.2, 0.0]), q, o) for p, q, o in stops]

    actions = fit(recordings(8, change=one_is_off)).plans[0].at(scene(NEW))
    assert off(actions, EXPECTED)[0] < 1e-6


def test_a_coordinate_may_follow_the_world_where_the_others_follow_an_object():
    def at_one_height(number, objects, stops):
        level = [(np.array([*p[:2], 0.9]) if k in (1, 3) else p, q, o) for k, (p, q, o) in enumerate(stops)]
        higher = [replace(pose, position_m=pose.position_m + np.array([0, 0, 0.01 * number])) for pose in objects]
        return higher, level

    rows = fit(recordings(6, change=at_one_height)).plans[0].rows
    x, y, z = rows[0].frame.place
    assert x.one == y.one == "<0>"
    assert z.kind == "world"


def test_a_cube_that_is_seen_from_any_side_is_grasped_as_shown():
    def seen_from_any_side(number, objects, stops):
        cup, coaster = objects
        turned = turns.product(cup.quaternion_xyzw, turns.about_z(number % 4 * np.pi / 2))
        return (replace(cup, quaternion_xyzw=turned), coaster), stops

    plan = fit(recordings(8, change=seen_from_any_side)).plans[0]
    assert plan.rows[1].scale[3:].max() < np.radians(3)


def test_a_row_is_the_inverse_of_its_residual(skill):
    row, here = skill.plans[0].rows[4], scene(NEW)
    action = row.at(here)
    np.testing.assert_allclose(row.residual(action, here), np.zeros(6), atol=1e-6)
    assert row.surprise(action, here).min() > 0.99
    away = replace(action, position_m=action.position_m + turns.rotated(here.axes(row.frame.axes), (0.0, 0.03, 0.0)))
    np.testing.assert_allclose(row.residual(away, here)[:3], (0.0, 0.03, 0.0), atol=1e-9)
    assert row.surprise(away, here)[1] < 1e-3 < row.surprise(away, here)[0]


def test_an_answer_that_is_off_is_named(skill):
    here = scene(NEW)
    actions = skill.plan_for(here).at(here)
    assert skill.of_answer(actions, here, 1e-3) == []
    actions[1] = replace(actions[1], position_m=actions[1].position_m + np.array([0.0, 0.0, 0.04]))
    (worst, *_) = skill.of_answer(actions, here, 1e-3)
    assert (worst.about, worst.coordinate) == ("action 1", "z")
    assert worst.value == pytest.approx(0.04)


def test_a_motion_from_the_start_follows_that_where_scenes_tell_it():
    def from_start(number, objects, stops):
        random = np.random.default_rng(number)
        start = HOME_M + random.uniform(-0.2, 0.2, 3)
        ways = [np.array(w) for w in ((0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0.1, 0.1, -0.1))]
        hands = stops[0][1]
        return objects, [(start + way, hands, True) for way in ways]

    shown = recordings(8, change=from_start)
    plan = fit(shown).plans[0]
    at = scene(NEW, home(HOME_M + 0.1))
    np.testing.assert_allclose(plan.at(at)[-1].position_m, HOME_M + 0.1 + (0.1, 0.1, -0.1), atol=1e-6)
    (other,) = fit(shown, knows_start=False).plans
    assert not any(row.frame.needs_start for row in other.rows)
    unknown = replace(at, start=np.full(3, np.nan), start_turn=np.full(4, np.nan))
    assert np.isfinite(other.at(unknown)[-1].position_m).all()


def test_what_the_hand_holds_moves_with_it_and_lies_where_it_is_let_go(skill):
    here = scene(NEW)
    after = here.after(skill.plan_for(here).at(here))
    cup, coaster = (after.keys.index(key) for key in ("<0>", "<1>"))
    np.testing.assert_allclose(after.place[cup], NEW[1].position_m + np.array([0, 0, 0.05]), atol=1e-6)
    np.testing.assert_allclose(after.place[coaster], NEW[1].position_m)
    np.testing.assert_allclose(after.start, EXPECTED[-1][0], atol=1e-6)


def test_posed_objects_have_roles():
    assert scene([posed("cup", (0, 0, 0)), posed("coaster", (0.2, 0, 0))]).keys == ("<0>", "<1>")
