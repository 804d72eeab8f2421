"""What a program can do."""

import pytest
from scipy.spatial.transform import Rotation

from app.evaluation.voxposer.program import answer_to
from app.evaluation.voxposer.voxels import pointing_down, turned, yaw_deg
from tests.evaluation.voxposer.scenes import GO, SCENE


def answer(program):
    return answer_to({"program": program, "scene": SCENE.to_json()})


def gone_to(expression, before=""):
    """The voxel that an expression of a program stands for."""
    program = f"{before}\ntarget = empty_affordance_map()\nset_voxels(target, {expression})\nmove(target)"
    answered = answer(program)
    assert "error" not in answered, answered
    (((box, _),),) = [move["affordance"] for move in answered["moves"]]
    return tuple(first for first, _ in box)


@pytest.mark.parametrize(
    ("expression", "voxel"),
    [
        ("detect('cube')", (50, 60, 20)),
        ("detect('cube').position", (50, 60, 20)),
        ("hand()", (30, 50, 60)),
        ("(1, 2, 3)", (1, 2, 3)),
        ("shifted(detect('cube'), 0, 0, 10)", (50, 60, 30)),
        ("shifted((50, 60, 20), 1.2, z_cm=-3)", (51, 60, 17)),
        ("shifted_along(detect('box'), 10, 0, 1)", (60, 39, 26)),  # its x axis is the world's y
        ("detect('cube').low", (48, 58, 18)),
        ("detect('cube').high", (52, 62, 22)),
        ("(len(detect('cube').voxels), int(detect('box').yaw_deg), round(detect('cube').size_cm[0]))", (54, 90, 5)),
        ("(cm_to_voxels(4.6, 'x'), int(voxels_to_cm(7)), abs(-3))", (5, 7, 3)),
        ("(max(1, 2, 3), min((4, 5)), sum([1, 2, 3]))", (3, 4, 6)),
        ("(7 // 2, 7 % 4, -2 + 5)", (3, 3, 3)),
        ("(1, 2, 3) if 2 in (1, 2) and not 'cube' == 'box' else (4, 5, 6)", (1, 2, 3)),
        ("detect('cube').voxels[0]", (48, 59, 19)),
    ],
)
def test_expressions(expression, voxel):
    assert gone_to(expression) == voxel


def test_functions_loops_and_branches():
    program = """
def highest(values):
    best = -1
    for number, value in enumerate(values):
        if value > best and number < 3:
            best = value
    return best

count = 0
for a, b in zip((1, 2, 3), (10, 20, 30)):
    count += a * b
"""
    assert gone_to("(highest((4, 9, 2, 50)), count // 2, 1)", program) == (9, 70, 1)


def test_a_later_box_that_covers_everything_hides_the_ones_before():
    program = GO.replace(
        "move(target)",
        "fingers = empty_gripper_map()\nfingers[1, 2, 3] = 1\nfingers[:] = 0\nmove(target, gripper=fingers)",
    )
    (move,) = answer(program)["moves"]
    assert move["gripper"] == [(((0, 100), (0, 100), (0, 100)), 0)]


def test_radius_and_margin_are_in_cm():
    program = GO.replace(
        "move(target)", "a = empty_avoidance_map()\nset_object(a, detect('box'), 1, 5)\nmove(target, a)"
    )
    (move,) = answer(program)["moves"]
    ((box, value),) = move["avoidance"]
    assert (box, value) == (((53, 68), (22, 37), (18, 33)), 1)


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("", "the program has no move"),
        ("x = 1\n", "the program has no move"),
        ("I would rather not move today.", "is no Python"),
        ("detect('mug')", "line 1: detect: there is no object 'mug' (valid: 'cube', 'box')"),
        ("move(empty_affordance_map())", "line 1: move: no voxel of the affordance map is above 0"),
        ("move(empty_gripper_map())", "move: affordance is no affordance map"),
        ("move()", "line 1: Commands.move() missing 1 required positional argument: 'affordance'"),
        ("detect('cube', 'box')", "line 1: Commands.detect() takes 2 positional arguments but 3 were given"),
        ("m = empty_gripper_map()\nm[:, :, :] = 0.5", "line 2: a gripper map holds 0.5 (valid: 1 open, 0 closed)"),
        ("m = empty_velocity_map()\nm[:] = 0", "a velocity map holds 0"),
        ("m = empty_rotation_map()\nm[:] = 1", "a rotation map holds quaternions"),
        ("m = empty_rotation_map()\nm[:] = (1, 1, 0, 0)", "is not of length 1"),
        ("m = empty_affordance_map()\nm[100, 0, 0] = 1", "an index of a map is a whole number 0..99"),
        ("m = empty_affordance_map()\nset_voxels(m, (1, 2))", "a position is three whole numbers"),
        ("m = empty_affordance_map()\nx = m[1, 2, 3]", "not subscriptable"),
        ("x = unknown", "line 1: name 'unknown' is not defined"),
        ("x = 1 / 0", "line 1: division by zero"),
        ("x = (1, 2)[5]", "line 1: tuple index out of range"),
        ("a, b = (1, 2, 3)", "too many values to unpack"),
        ("return 1", "'return' outside function"),
        ("def f(x):\n    pass\nf()", "line 3: f() missing 1 required positional argument"),
        ("shifted(detect('cube'), 5000)", "a length is 5000 cm"),
        ("cm_to_voxels(1, 'w')", "there is no such axis"),
        ("for x in 5:\n    pass", "line 1: 'int' object is not iterable"),
    ],
)
def test_mistakes_are_named(program, why):
    assert why in answer(program)["error"]


def test_rotations_agree_with_scipy():
    for yaw, tilt in ((0, 0), (30, 20), (-70, 34), (135, -40)):
        turn = Rotation.from_euler("ZYX", [yaw, -tilt, 180], degrees=True)
        found = Rotation.from_quat(pointing_down(yaw, tilt))
        assert (turn.inv() * found).magnitude() < 1e-9
    turn = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    assert turned(turn.as_quat(), (1, 2, 3)) == pytest.approx(turn.apply([1, 2, 3]))
    assert yaw_deg(Rotation.from_euler("z", 40, degrees=True).as_quat()) == pytest.approx(40)
