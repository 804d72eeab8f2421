import numpy as np

from app.pipeline.skill.skill import fit
from app.pipeline.skill.ways import told_apart, two_kinds
from tests.pipeline.skill.shown import drawn, posed, recordings, scene, stops_of

BESIDE_M = np.array([0.0, 0.15, 0.0])


def beside(stops):
    """The hand lets go beside the coaster."""
    return [(p + BESIDE_M if k > 3 else p, q, o) for k, (p, q, o) in enumerate(stops)]


def test_a_quantity_of_the_scene_calls_for_a_way():
    def by_side(number, objects, stops):
        return objects, beside(stops) if objects[1].position_m[1] > 0 else stops

    skill = fit(recordings(24, change=by_side))
    assert len(skill.plans) == 2
    for seed in range(100, 108):
        objects = drawn(np.random.default_rng(seed))
        here = scene(objects)
        plan = skill.plan_for(here)
        if all(condition.is_clear(here) for condition in plan.when):
            stops = stops_of(*objects)
            expected = (beside(stops) if objects[1].position_m[1] > 0 else stops)[-1][0]
            np.testing.assert_allclose(plan.at(here)[-1].position_m, expected, atol=1e-6)


def test_a_way_that_nothing_explains_is_a_doubt():
    chosen = np.random.default_rng(8).permutation(10) < 5
    skill = fit(recordings(10, change=lambda n, objects, stops: (objects, beside(stops) if chosen[n] else stops)))
    assert len(skill.plans) == 1
    assert "uncertain-act" in {doubt.code for doubt in skill.of_demonstrations if doubt.danger}


def test_other_switches_of_the_gripper_are_another_way():
    def keeps_hold(number, objects, stops):
        return objects, stops if number % 5 else [(p, q, o and k < 5) for k, (p, q, o) in enumerate(stops)]

    skill = fit(recordings(10, change=keeps_hold))
    assert [len(plan.members) for plan in skill.plans] == [8, 2]
    assert skill.plan_for(scene(drawn(np.random.default_rng(1)))) is skill.plans[0]
    assert "several-ways" in {doubt.code for doubt in skill.of_demonstrations}


def test_noise_is_one_way():
    residuals = 0.002 * np.random.default_rng(4).normal(size=(3, 6, 10))
    gain, _ = two_kinds(residuals, 3)
    assert gain == 0


def test_chance_tells_no_ways_apart():
    random = np.random.default_rng(2)
    scenes = [item.scene for item in recordings(10)]
    stacked = type(scenes[0]).stacked(scenes, scenes[0].keys)
    found = [told_apart(stacked, random.permutation(10) < 5) for _ in range(50)]
    assert sum(one is not None for one in found) <= 2


def test_between_ways_it_is_a_guess():
    def by_side(number, objects, stops):
        return objects, beside(stops) if objects[1].position_m[1] > 0 else stops

    skill = fit(recordings(24, change=by_side))
    low, high = skill.plans[0].when[0].between
    here = scene([posed("cup", (0.3, 0.2, 0.82)), posed("coaster", (0.1, (low + high) / 2, 0.8))])
    assert "several-ways" in {doubt.code for doubt in skill.of_scene(here)}
