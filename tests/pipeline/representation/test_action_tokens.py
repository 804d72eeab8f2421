import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from roboprompt_client.types.poses import EndEffectorAction
from tests.pipeline.asking import codec_of, grammar_of, parse_reply, schema_of

from ..gbnf import matches
from ..scenes import WORKSPACE, action, angle_deg, demonstration, pose

DRAWER = pose("drawer", (0.125, 0.155, 0.895))
JAR = pose("jar", (-0.0126, -0.2, 0.8), 45)
# the gripper points down: its x axis is the world's, its y axis the world's turned round
ACTIONS = (action((0.165, 0.245, 1.155)), action((-0.05, 0.0, 0.9), (0, 0, 90), False))
ROW = "[165, 245, 1155, 265, 245, 1155, 165, 145, 1155, 1]"
ROW_2 = "[-50, 0, 900, -50, 100, 900, -150, 0, 900, 0]"
OPEN = demonstration("open the drawer", [DRAWER, JAR], ACTIONS)
NUM_RANDOM = 500


def fitted(prompt_format="paper", *demonstrations):
    return codec_of("action_tokens", prompt_format, demonstrations or (OPEN,), WORKSPACE)


@pytest.mark.parametrize(
    ("prompt_format", "observation", "end"),
    [
        ("paper", "{'drawer': [42, 65, 29], 'jar': [28, 29, 19, 36, 36, 45], 'open the drawer'}>", ", "),
        ("authors", "{'drawer': [42, 65, 29], 'jar': [28, 29, 19, 36, 36, 45]}>", ", "),
    ],
)
def test_text(prompt_format, observation, end):
    codec = fitted(prompt_format)
    assert codec.observation_text(Query("open the drawer", OPEN.objects)) == observation
    assert codec.actions_text(OPEN) == f"[{ROW}, {ROW_2}]"
    assert codec.demonstration_text(OPEN) == f"{observation}[{ROW}, {ROW_2}]{end}"
    assert observation.startswith(codec.stop)
    assert not any(stop in f"[{ROW}, {ROW_2}]{end}" for stop in codec.stop)


def random_actions():
    """Poses over two meters on both sides of the world's origin, in every orientation."""
    random = np.random.default_rng(7)
    positions_m = random.uniform(-2, 2, (NUM_RANDOM, 3))
    rotations = Rotation.random(NUM_RANDOM, rng=random)
    return [
        EndEffectorAction(position_m, quaternion_xyzw, bool(k % 2))
        for k, (position_m, quaternion_xyzw) in enumerate(zip(positions_m, rotations.as_quat(), strict=True))
    ]


def test_actions_are_written_and_read_within_the_rounding():
    for given in random_actions():
        shown = demonstration("go", [DRAWER], [given])
        text = fitted("paper", shown).actions_text(shown)
        assert matches(grammar_of(fitted("paper", shown), "go"), text)
        (seen,) = parse_reply(text, fitted(), [DRAWER], "go")
        assert np.linalg.norm(seen.position_m - given.position_m) <= 0.001
        assert angle_deg(seen.quaternion_xyzw, given.quaternion_xyzw) <= 1.5
        assert seen.gripper_open == given.gripper_open


def bent(x_mm):
    """The first row with point 2 displaced along the axis that it stands for."""
    return f"[[165, 245, 1155, {265 + x_mm}, 245, 1155, 165, 145, 1155, 1]]"


def read(reply_text, prompt_format="paper"):
    return parse_reply(reply_text, fitted(prompt_format), [DRAWER], "go")


@pytest.mark.parametrize("x_mm", [-15, -5, 0, 5, 15])
def test_a_slightly_bent_triplet_is_taken_for_the_nearest_pose(x_mm):
    (seen,) = read(bent(x_mm))
    assert np.linalg.norm(seen.position_m - ACTIONS[0].position_m) <= abs(x_mm) / 1000 + 1e-9
    assert angle_deg(seen.quaternion_xyzw, ACTIONS[0].quaternion_xyzw) < 5


@pytest.mark.parametrize("x_mm", [-60, -25, 25, 60, 900])
def test_a_badly_bent_triplet_is_refused_with_its_residual(x_mm):
    # at a leg changed by d along itself, no pose is nearer than about 0.41 d (rms)
    with pytest.raises(ReplyParseError, match=r"action 0: its three points are (\d+\.\d) mm") as caught:
        read(bent(x_mm))
    residual_mm = float(caught.value.message.split("are ")[1].split(" mm")[0])
    assert 0.35 * abs(x_mm) < residual_mm < 0.48 * abs(x_mm)
    assert "at most 8.7 mm" in caught.value.message


@pytest.mark.parametrize(
    "row",
    [
        "[0, 0, 0, 0, 0, 0, 0, 0, 0, 1]",
        "[5, 5, 5, 5, 5, 5, 5, 5, 5, 1]",
        "[0, 0, 0, 100, 0, 0, 200, 0, 0, 1]",
        "[0, 0, 0, 100, 0, 0, 100, 0, 0, 1]",
        "[-1, 7, 3, 32, 106, 201, -34, -92, -195, 1]",
    ],
)
def test_points_on_one_line_are_no_pose(row):
    with pytest.raises(ReplyParseError, match="action 0: its three points lie on one line"):
        read(f"[{row}]")


REFUSED = {
    "[[46, 74, 55, 54, 36, 37, 1]]": "action 0 has 7 elements, expected 10",
    "[[165.5, 245, 1155, 265, 245, 1155, 165, 145, 1155, 1]]": "action 0: x of point 1 is 165.5",
    "[[165, 245, 1155, 265, 100000, 1155, 165, 145, 1155, 1]]": "action 0: y of point 2 is 100000",
    "[[165, 245, 1155, 265, 245, 1155, 165, 145, 1155, 2]]": "action 0: gripper is 2, expected an integer from 0 to 1",
    "[[[165, 245, 1155], [265, 245, 1155], [165, 145, 1155], 1]]": "action 0 is not a list of numbers",
}


@pytest.mark.parametrize(("reply_text", "message"), REFUSED.items(), ids=lambda text: text[:40])
def test_refused_replies_carry_their_text(reply_text, message):
    with pytest.raises(ReplyParseError) as caught:
        read(reply_text)
    assert message in caught.value.message
    assert caught.value.reply_text == reply_text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"[{ROW}, {ROW_2}]", True),
        (f"[{ROW}, {ROW_2}, {ROW}]", True),
        (f"[{ROW}, [-0, 0, 900, -50, 100, 900, -150, 0, 900, 0]]", False),
        (f"[{ROW}, [050, 0, 900, -50, 100, 900, -150, 0, 900, 0]]", False),
        (f"[{ROW}, [123456, 0, 900, -50, 100, 900, -150, 0, 900, 0]]", False),
        (f"[{ROW}, [0, 900, -50, 100, 900, -150, 0, 900, 0]]", False),
    ],
)
def test_the_grammar_knows_rows_and_their_number(text, expected):
    longer = demonstration("open the drawer", [DRAWER], [*ACTIONS, ACTIONS[0]])
    codec = fitted("paper", OPEN, longer)
    assert matches(grammar_of(codec, "open the drawer"), text) is expected
    if expected:
        Draft202012Validator(schema_of(codec, "open the drawer")).validate(json.loads(text))
