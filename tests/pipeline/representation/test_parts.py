from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.prompt import PromptTemplate
from app.pipeline.representation.parts import PartsCodec, in_sequence
from roboprompt_client.errors import InvalidInputError
from tests.pipeline.asking import grammar_of, parse_reply

from ..gbnf import matches
from ..scenes import action, angle_deg, demonstration, pose

COLORS = ("red", "green", "blue", "yellow")
BLOCK_M, HOVER_M = 0.045, 0.1
TILTED_DEG = (180, 20, 0)


def scene(seed):
    """A plate and four blocks, anywhere on a table."""
    rng = np.random.default_rng(seed)
    places_m = [(*rng.uniform(-0.3, 0.3, 2), 0.8) for _ in range(1 + len(COLORS))]
    names = ["white plate", *(f"{color} block" for color in COLORS)]
    return [pose(name, place_m, 0.0) for name, place_m in zip(names, places_m, strict=True)]


def tower(objects, colors):
    """The actions that stack blocks of these colors on the plate."""
    plate, *blocks = objects
    actions = []
    for level, color in enumerate(colors, 1):
        block = next(item for item in blocks if item.name.startswith(color))
        on_m = plate.position_m + np.array([0, 0, BLOCK_M * level])
        for place_m, before, at in ((block.position_m, True, False), (on_m, False, True)):
            above_m = place_m + np.array([0, 0, HOVER_M])
            actions += [action(above_m, gripper_open=before), action(place_m, gripper_open=at)]
            actions += [action(above_m, gripper_open=at)]
    return actions


def built(seed, height, colors=COLORS):
    objects = scene(seed)
    instruction = f"build a tower {height} high on the white plate"
    return demonstration(instruction, objects, tower(objects, colors[:height]))


HEIGHTS = [1, 2, 4] * 3
TAUGHT = [built(seed, height) for seed, height in enumerate(HEIGHTS)]
THREE = "build a tower 3 high on the white plate"
REPLY = """
1. grasp red block
2. release 1 white plate
3. grasp green block
4. release 2 white plate
5. grasp blue block
6. release 3 white plate"""


@pytest.fixture(scope="module")
def codec():
    return PartsCodec.fit(TAUGHT, with_instruction=True)


def test_a_prompt_names_parts_and_objects(codec):
    template = PromptTemplate.write(codec, TAUGHT, "")
    assert template.prefix.split("\n\n")[0].splitlines() == [
        "Objects: white plate, red block, green block, blue block, yellow block",
        "Instruction: build a tower 1 high on the white plate",
        "Steps:",
        "1. grasp red block",
        "2. release 1 white plate",
    ]
    asked = template.ask(Query(THREE, tuple(scene(100))), 25)
    assert asked.user.endswith(f"Instruction: {THREE}\nSteps:")
    assert [part.words for part in codec.common.parts] == ["grasp", *(f"release {level}" for level in (1, 2, 3, 4))]


@pytest.mark.parametrize("colors", [("red", "green", "blue"), ("yellow", "red", "green")])
def test_parts_make_a_motion_that_no_demonstration_has(codec, colors):
    reply = REPLY
    for number, (shown, color) in enumerate(zip(COLORS, colors, strict=False)):
        reply = reply.replace(f"{2 * number + 1}. grasp {shown}", f"{2 * number + 1}. grasp {color}")
    objects = scene(100)
    actions, expected = parse_reply(reply, codec, objects, THREE), tower(objects, colors)
    assert [item.gripper_open for item in actions] == [item.gripper_open for item in expected]
    for item, right in zip(actions, expected, strict=True):
        np.testing.assert_allclose(item.position_m, right.position_m, atol=0.003)
        assert angle_deg(item.quaternion_xyzw, right.quaternion_xyzw) < 3
    assert matches(grammar_of(codec, THREE), reply)
    assert codec.reply_text(codec.rows(reply, complete=True)) == reply


def test_a_reply_is_read_while_it_arrives(codec):
    assert codec.rows("\n1. grasp red block\n2. relea", complete=False) == ["1. grasp red block"]


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        ("2. grasp red block", "expected '1. PART OBJECT'"),
        ("I would grasp it", "expected '1. PART OBJECT'"),
        ("1. grasp white plate", "expected one of grasp red block"),
        ("1. grasp red block\n2. throw red block", "step 1 is 'throw red block'"),
        ("1. grasp red block\n2. grasp red block\n3. grasp red block", "9 actions, more than 8"),
    ],
)
def test_wrong_replies(codec, reply, said):
    with pytest.raises(ReplyParseError, match=said):
        parse_reply(reply, codec, scene(100), THREE, max_actions=8)


@pytest.mark.parametrize(
    "reply", ["\n1. grasp white plate", "\n1. release 5 white plate", "\nSure: 1. grasp red block"]
)
def test_what_the_grammar_leaves_out(codec, reply):
    assert not matches(grammar_of(codec, THREE), reply)


def test_a_demonstration_with_an_action_of_its_own_is_not_shown():
    objects = scene(50)
    odd = demonstration(THREE, objects, [*tower(objects, COLORS[:1]), action((0.1, 0.1, 1.2), TILTED_DEG)])
    codec = PartsCodec.fit([*TAUGHT, odd], with_instruction=True)
    assert codec.needed() == tuple(TAUGHT)


def test_demonstrations_without_common_parts_are_refused():
    rng = np.random.default_rng(1)
    actions = [[action(rng.uniform(0.7, 1.2, 3)) for _ in range(2)] for _ in range(4)]
    apart = [demonstration("wave", scene(seed), own) for seed, own in enumerate(actions)]
    with pytest.raises(InvalidInputError, match="no demonstration consists of parts"):
        PartsCodec.fit(apart, with_instruction=True)


def test_an_observation_says_what_is_at_what(codec):
    plate, red, *others = scene(100)
    on_plate = pose(red.name, plate.position_m + np.array([0.02, 0, BLOCK_M]), 0.0)
    text = codec.observation_text(Query(THREE, (plate, on_plate, *others)))
    assert text.startswith("Objects: green block, blue block, yellow block\nAt white plate: red block\nInstruction:")


@pytest.mark.parametrize(
    ("said", "written"),
    [
        ("press the red button after the blue button", "press the blue button, then the red button"),
        ("press the red button before the cap", "press the red button, then the cap"),
        ("press red button after the cap after blue button", "press blue button, then the cap, then the red button"),
        ("press the red button after taking the blue button",) * 2,
        ("press the red button before the blue button after the cap",) * 2,
        ("press the red button",) * 2,
    ],
)
def test_an_instruction_is_written_in_the_order_of_execution(said, written):
    assert in_sequence(said, ("red button", "blue button", "cap")) == written


def placed_beside(seed, side, by_m):
    """Put the red block to the left (+1) or right of the green one."""
    _, red, green, *_ = objects = scene(seed)
    words = f"put the red block {'far' if by_m > 0.15 else 'close'} to the {'left' if side > 0 else 'right'}"
    on_m = green.position_m + np.array([0, side * by_m, 0])
    actions = [action(red.position_m), action(red.position_m, gripper_open=False), action(on_m, gripper_open=False)]
    return demonstration(f"{words} of the green block", objects, [*actions, action(on_m)])


def test_steps_that_nothing_in_the_text_decides_are_refused():
    sides = [replace(placed_beside(seed, 1 - 2 * (seed % 2), 0.1), instruction="tidy up") for seed in range(8)]
    with pytest.raises(InvalidInputError, match="read alike have different steps"):
        PartsCodec.fit(sides, with_instruction=True)
