from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from app.perception.base import LabeledScene, ObjectQuery
from app.perception.cuboid.estimator import CuboidPoses
from app.perception.cuboid.learn import learn_models
from app.perception.cuboid.segmentation import color_mask, to_hsv
from roboprompt_client.errors import InvalidInputError
from tests.perception.solid_scene import FRONT, LEFT, Solid, cube, labeled, shoot

BAR_M = (0.08, 0.04, 0.03)


@lru_cache(maxsize=16)
def shot(solids, view, seed):
    """Several tests look at the same scenes with other labels."""
    return shoot(solids, view, seed)


def scenes(solids_of, count=3, labels=labeled, views=(FRONT, LEFT)):
    """`solids_of` gives the named solids of a scene from a random generator."""
    made = []
    for seed in range(count):
        named = solids_of(np.random.default_rng(seed))
        frames = tuple(shot(tuple(named.values()), view, seed) for view in views)
        objects = tuple(labels(name, solid, k) for k, (name, solid) in enumerate(named.items(), 1) if name[0] != "_")
        made.append(LabeledScene(frames, objects))
    return made


def anywhere(random, **solids):
    """Named solids at random places of their own."""
    x = random.permutation(len(solids)) * 0.12 - 0.1
    return {
        name: replace(
            solid, position_m=(x[k], random.uniform(-0.1, 0.1), solid.size_m[2] / 2), yaw_rad=random.uniform(-3, 3)
        )
        for k, (name, solid) in enumerate(solids.items())
    }


def cube_and_bar(random):
    return anywhere(random, cube=cube("red", 0, 0), bar=Solid("green", (0, 0, 0), 0, BAR_M))


@pytest.fixture(scope="module")
def models():
    return learn_models(scenes(cube_and_bar))


def test_size_shape_and_color_are_learned_from_masks_and_poses(models):
    np.testing.assert_allclose(models["cube"].size_m, [0.05] * 3, atol=0.0015)
    np.testing.assert_allclose(models["bar"].size_m, BAR_M, atol=0.002)
    assert models["cube"].shape_symmetry_deg == 90  # nearly equal sides were made equal
    assert models["bar"].shape_symmetry_deg == 180
    for name, model in models.items():
        np.testing.assert_allclose(model.origin_m, 0, atol=0.0015)
        frame = shoot(list(cube_and_bar(np.random.default_rng(99)).values()), FRONT, 99)
        mask = color_mask(to_hsv(frame.rgb), model.color) > 0
        own = frame.mask == (1 if name == "cube" else 2)
        assert (mask & own).sum() > 0.95 * own.sum()
        assert (mask & ~own).sum() < 0.01 * own.sum()


def test_what_was_learned_finds_the_objects_of_another_scene(models):
    named = cube_and_bar(np.random.default_rng(99))
    frame = shoot(list(named.values()), FRONT, 99)
    poses = CuboidPoses().estimate([ObjectQuery(name, model=models[name]) for name in named], [frame])
    for pose, solid in zip(poses, named.values(), strict=True):
        np.testing.assert_allclose(pose.position_m, solid.position_m, atol=0.003)


def test_masks_do_without_poses():
    def masks_only(name, solid, number):
        return ObjectQuery(name, mask_ids=(number,))

    models = learn_models(scenes(cube_and_bar, labels=masks_only))
    np.testing.assert_allclose(models["bar"].size_m, BAR_M, atol=0.002)


def test_wrong_labels_are_found_out():
    def shifted(name, solid, number):
        x, y, z = solid.position_m
        return labeled(name, replace(solid, position_m=(x + (0.1 if x > 0 else 0), y, z)), number)

    with pytest.raises(InvalidInputError) as caught:
        learn_models(scenes(cube_and_bar, labels=shifted))
    assert caught.value.field.startswith("object_models[")


def test_given_positions_do_without_masks():
    def positions_only(name, solid, number):
        return ObjectQuery(name, solid.position_m)

    model = learn_models(scenes(lambda random: anywhere(random, cube=cube("red", 0, 0)), labels=positions_only))["cube"]
    np.testing.assert_allclose(model.size_m, [0.05] * 3, atol=0.002)
    assert abs(model.origin_m[2]) < 0.002


def test_a_round_button_is_learned_as_a_cylinder_with_its_pose_on_top():
    def on_top(name, solid, number):
        x, y, z = solid.position_m
        return labeled(name, replace(solid, position_m=(x, y, z + solid.size_m[2] / 2)), number)

    button = Solid("yellow", (0, 0, 0), 0, (0.06, 0.06, 0.03), round=True)
    seen = scenes(lambda random: anywhere(random, button=button), labels=on_top)
    model = learn_models(seen, {"button": 0.0})["button"]
    assert model.shape == "cylinder"
    np.testing.assert_allclose(model.size_m, [0.06, 0.06, 0.03], atol=0.002)
    np.testing.assert_allclose(model.origin_m, [0, 0, 0.015], atol=0.002)


def test_a_round_shape_with_a_yaw_is_refused():
    cup = Solid("yellow", (0, 0, 0), 0, (0.06, 0.06, 0.08), round=True)
    with pytest.raises(InvalidInputError, match=r"given yaws differ by up to \d+ degrees") as caught:
        learn_models(scenes(lambda random: anywhere(random, cup=cup)))
    assert "yaw_symmetry_deg" in caught.value.valid


def test_a_rank_is_learned_where_several_look_alike():
    def several(random):
        angles = random.permutation(3) * 2.1 + random.uniform(0, 6)
        mat = Solid("green", (0, 0, 0.002), 0.3, (0.08, 0.08, 0.004))
        blocks = [cube("red", r * np.cos(a), r * np.sin(a), a) for r, a in zip((0.09, 0.12, 0.15), angles, strict=True)]
        return {"mat": mat, "near": blocks[0], "second": blocks[1], "_far": blocks[2]}

    models = learn_models(scenes(several))
    assert models["mat"].rank is None
    for name, number in (("near", 1), ("second", 2)):
        rank = models[name].rank
        assert (rank.number, rank.nearest_to, rank.of) == (number, "mat", 3)
    assert (models["near"].size_m, models["near"].color) == (models["second"].size_m, models["second"].color)


def test_alike_without_a_rule_is_refused():
    def pair(random):
        return anywhere(random, one=cube("red", 0, 0), _other=cube("red", 0, 0))

    with pytest.raises(InvalidInputError, match="up to 2 things look like it") as caught:
        learn_models(scenes(pair))
    assert caught.value.field == "object_models[one]"


def test_an_object_without_a_color_is_refused():
    with pytest.raises(InvalidInputError, match="have a color") as caught:
        learn_models(scenes(lambda random: anywhere(random, box=cube("grey", 0, 0)), count=2))
    assert caught.value.field == "object_models[box]"


def test_there_must_be_something_to_learn_from():
    with pytest.raises(InvalidInputError) as caught:
        learn_models([])
    assert caught.value.field == "episodes"
    hidden = LabeledScene((shoot([]),), (ObjectQuery("cube", mask_ids=(7,)),))
    with pytest.raises(InvalidInputError, match="no camera shows it"):
        learn_models([hidden])
