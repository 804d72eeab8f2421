"""Doubts about an observed scene: each cause is found, alone, and what is as shown is not."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.demonstrated_scenes import ShownScenes
from app.pipeline.findings.places import ShownPlaces, estimated_error_m
from app.pipeline.findings.scene import scene_findings
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.noise import disturbed
from tests.pipeline.scenes import demonstration, pose, rotated

STACK = "stack the red cube on the blue cube"
REVERSE = "stack the blue cube on the red cube"


def scene(x_m=0.1, y_m=0.0, yaw_deg=0.0):
    """A cube, another in front of it, and a box, which stands higher."""
    return (
        pose("red cube", (x_m, y_m, 0.80), yaw_deg),
        pose("blue cube", (x_m + 0.1, y_m + 0.2, 0.80), -yaw_deg),
        pose("box", (x_m - 0.3, y_m, 0.90), yaw_deg),
    )


SHOWN = [demonstration(STACK, scene(0.02 * k, 0.03 * (k % 5), 5 * (k % 7)), []) for k in range(10)]
OBSERVED = scene(0.09, 0.05, 12)


def found(observed, shown=SHOWN, instruction=STACK):
    findings = scene_findings(Query(instruction, tuple(observed)), ShownScenes(tuple(shown)))
    return [(finding.code, finding.severity, finding.where) for finding in findings]


def with_changed(name, **changes):
    return tuple(replace(item, **changes) if item.name == name else item for item in OBSERVED)


def moved(name, *way_m):
    position_m = next(item for item in OBSERVED if item.name == name).position_m
    return with_changed(name, position_m=position_m + np.array(way_m))


def turned(name, *euler_deg):
    turn = Rotation.from_quat(next(item for item in OBSERVED if item.name == name).quaternion_xyzw)
    return with_changed(name, quaternion_xyzw=(rotated(*euler_deg) * turn).as_quat())


def test_a_scene_as_demonstrated_has_no_finding():
    assert found(OBSERVED) == []


CAUSES = [
    (moved("red cube", 0.4, 0, 0), ("object-beyond-demonstrations", "danger", "objects[red cube]")),
    (moved("red cube", 0, -0.15, 0), ("object-beyond-demonstrations", "warning", "objects[red cube]")),
    (moved("red cube", 0, 0, 0.015), ("object-at-another-height", "warning", "objects[red cube]")),
    (moved("red cube", 0, 0, 0.02), ("object-at-another-height", "danger", "objects[red cube]")),
    (turned("red cube", 70, 0, 0), ("object-tilted", "danger", "objects[red cube]")),
    (turned("red cube", 0, 0, 60), ("object-turned", "danger", "objects[red cube]")),
    (moved("red cube", 0.1, 0.19, 0), ("objects-in-one-place", "danger", "objects[red cube]")),
    (
        with_changed("red cube", confidence=0.6, reason="half hidden", estimator="cuboid"),
        ("uncertain-pose", "warning", "objects[red cube]"),
    ),
    (
        with_changed("red cube", confidence=0.9, reason="half hidden", estimator="cuboid"),
        ("uncertain-pose", "info", "objects[red cube]"),
    ),
]


@pytest.mark.parametrize(("observed", "expected"), CAUSES, ids=[f"{c}-{s}" for _, (c, s, _) in CAUSES])
def test_each_cause_is_found_alone(observed, expected):
    assert found(observed) == [expected]


def test_a_lesser_doubt_hides_no_greater_one():
    """An object that stands a little higher and far away, and one that hangs in the air."""
    assert [kind[:2] for kind in found(moved("red cube", 0.5, 0, 0.015))] == [
        ("object-at-another-height", "warning"),
        ("object-beyond-demonstrations", "danger"),
    ]
    assert ("object-beyond-demonstrations", "danger") in [kind[:2] for kind in found(moved("red cube", 0, 0, 0.7))]


@pytest.mark.parametrize(
    ("higher_m", "noise_m", "expected"),
    [(0.005, 0.0, True), (0.012, 0.001, True), (0.1, 0, True), (0.009, 0.0035, False)],
)
def test_objects_under_each_others_names_are_recognized_by_their_heights(higher_m, noise_m, expected):
    random = np.random.default_rng(0)
    shown = [with_box(item.objects, higher_m + random.uniform(-noise_m, noise_m)) for item in SHOWN]
    cube, blue, box = with_box(OBSERVED, higher_m).objects
    swapped = (replace(box, name=cube.name), blue, replace(cube, name=box.name))
    danger = ("objects-in-each-others-place", "danger", "objects[red cube]")
    assert (found(swapped, shown)[:1] == [danger]) == expected
    assert found((cube, blue, box), shown) == []


def with_box(objects, higher_m):
    cube, blue, box = objects
    at_m = np.array([*box.position_m[:2], cube.position_m[2] + higher_m])
    return demonstration(STACK, (cube, blue, replace(box, position_m=at_m)), [])


def test_an_object_that_is_taken_for_another_is_one_finding():
    """It is at the other's height and place: what else is odd about it follows."""
    box = OBSERVED[2]
    assert found(with_changed("red cube", position_m=box.position_m, quaternion_xyzw=box.quaternion_xyzw)) == [
        ("objects-in-one-place", "danger", "objects[red cube]")
    ]


@pytest.mark.parametrize(
    ("fine_m", "off_m", "expected"), [(0.0001234, 0.0, True), (0.0001234, 0.0005, False), (0.0, 0.0, False)]
)
def test_a_scene_that_repeats_measured_places_is_an_old_one(fine_m, off_m, expected):
    """Not one that is written down in whole millimeters, nor one that is seen again."""
    shown = [demonstration(STACK, scene(0.02 * k + fine_m, 0.03 * (k % 5)), []) for k in range(10)]
    query = Query(STACK, scene(0.06 + fine_m + off_m, 0.09))
    for scenes in (ShownScenes(tuple(shown)), ShownScenes(tuple(shown[:3] + shown[4:]), left_out=(shown[3],))):
        codes = [finding.code for finding in scene_findings(query, scenes)]
        assert codes == (["scene-of-a-demonstration"] if expected else [])


def test_swapped_objects_are_recognized_by_the_order_of_mention():
    """Whatever is named first stands on the other in every demonstration, and both cubes have been above."""

    def tower(lower, upper, x_m):
        return (pose(lower, (x_m, 0, 0.8), 0), pose(upper, (x_m, 0, 0.85), 0))

    below, above = ("blue cube", "red cube"), ("red cube", "blue cube")
    shown = [
        demonstration(REVERSE if k % 2 else STACK, tower(*(above if k % 2 else below), 0.03 * k), []) for k in range(10)
    ]
    assert found(tower(*below, 0.1), shown, STACK) == []
    assert found(tower(*above, 0.1), shown, REVERSE) == []
    assert found(tower(*above, 0.1), shown, STACK) == [("objects-arranged-otherwise", "warning", "objects[red cube]")]


def test_the_size_of_the_noise_is_estimated():
    places = [ShownPlaces.of([shown.object(item.name) for shown in SHOWN]) for item in OBSERVED]
    estimates_m = [
        estimated_error_m(
            disturbed(OBSERVED, np.random.default_rng(k), mean_error_m=0.03, mean_error_rad=0.1437), places
        )
        for k in range(50)
    ]
    assert np.median(estimates_m) == pytest.approx(0.03, rel=0.15)


def test_few_demonstrations_say_little():
    assert found(moved("red cube", 0.4, 0, 0.1), SHOWN[:2]) == []
    assert found(moved("red cube", 0.02, 0, 0), SHOWN[:4]) == []
    assert len(found(moved("red cube", 0.06, 0, 0), SHOWN[:4])) == 1
