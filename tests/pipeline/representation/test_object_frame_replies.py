import numpy as np
import pytest

from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.object_frame import ObjectFrameCodec
from tests.pipeline.asking import grammar_of, parse_reply, shown_as_they_are

from ..gbnf import matches
from ..scenes import WORKSPACE, action, angle_deg, demonstration, pose, rotated

INSTRUCTION = "put the red cup on the plate"
TWO_CLAUSES = "lift the red cup, then put it on the plate"
CUP, PLATE = pose("red cup", (0.1234, 0.2, 0.7), 90), pose("plate", (0.4, -0.1, 0.65))
ROW = "1 A o: +10 -2 +20 0 36 54 1"
ROW_2 = "2 B w: +0 +0 +4 36 36 36 0"


def codec_for(*nums_actions, objects=(CUP, PLATE), instruction=INSTRUCTION):
    shown = [demonstration(instruction, objects, [action((0.1, 0.2, 0.8))] * n) for n in nums_actions]
    return ObjectFrameCodec.of(shown_as_they_are(shown), WORKSPACE, with_instruction=True)


@pytest.mark.parametrize(
    "reply_text",
    [
        f"{ROW}; {ROW_2}",
        f" {ROW}; {ROW_2}\n",
        f"\n{ROW};\n{ROW_2}\n\n",
        f"{ROW};{ROW_2}",
        f"```\n{ROW}; {ROW_2}\n```",
        f"```text\n{ROW}; {ROW_2}```",
    ],
)
def test_offsets_count_from_the_observed_pose_itself(reply_text):
    lifted, placed = parse_reply(reply_text, codec_for(2), [CUP, PLATE], INSTRUCTION)
    # 10 units along the cup's x axis are 5 cm along the world's y axis
    np.testing.assert_allclose(lifted.position_m, [0.1234 + 0.01, 0.2 + 0.05, 0.7 + 0.1])
    assert angle_deg(lifted.quaternion_xyzw, rotated(-180, 0, 180).as_quat()) < 1e-5
    assert lifted.gripper_open is True
    np.testing.assert_allclose(placed.position_m, [0.4, -0.1, 0.67])
    assert angle_deg(placed.quaternion_xyzw, rotated(0, 0, 0).as_quat()) < 1e-5
    assert placed.gripper_open is False


@pytest.mark.parametrize(
    ("reply_text", "message"),
    [
        ("", "action 0 is ''"),
        ("I cannot do that.", "action 0 is 'I cannot do that.'"),
        (f"{ROW};", "action 1 is ''"),
        (f"Sure: {ROW}", "action 0 is"),
        (f"{ROW}\n{ROW_2}", "action 0 is"),
        (f"{ROW}; {ROW_2}\nThat is all.", "action 1 is"),
        ("[[46, 74, 55, 54, 36, 37, 1]]", "action 0 is"),
        # numbers of rows
        (ROW_2, "action 0 has row number 2, expected 1"),
        (f"{ROW}; {ROW}", "action 1 has row number 1, expected 2"),
        (f"{'9' * 5000} A o: +10 -2 +20 0 36 54 1", "action 0 is '9999"),
        # letters and frames
        ("1 C w: +10 -2 +20 0 36 54 1", "relative to C w, expected one of A w, A o, B w"),
        ("1 a w: +10 -2 +20 0 36 54 1", "action 0 is"),
        ("1 B o: +10 -2 +20 0 36 54 1", "relative to B o, expected one of A w, A o, B w"),
        ("1 red cup w: +10 -2 +20 0 36 54 1", "action 0 is"),
        ("1 A q: +10 -2 +20 0 36 54 1", "action 0 is"),
        ("1 A: +10 -2 +20 0 36 54 1", "action 0 is"),
        # numbers
        ("1 A w: +10 -2 0 36 54 1", "action 0 is"),
        ("1 A w: +10 -2 +20 +0 36 54 1 1", "action 0 is"),
        ("1 A w: 10 -2 +20 0 36 54 1", "action 0 is"),
        ("1 A w: +1000 -2 +20 0 36 54 1", "action 0 is"),
        ("1 A w: +10 -2.5 +20 0 36 54 1", "action 0 is"),
        ("1 A w: +10 -2 +20 72 36 54 1", "action 0 has the rotations [72, 36, 54], expected 0 to 71"),
        ("1 A w: +10 -2 +20 0 36 99 1", "action 0 has the rotations [0, 36, 99]"),
        ("1 A w: +10 -2 +20 0 36 -5 1", "action 0 is"),
        ("1 A w: +10 -2 +20 0 36 54 2", "action 0 is"),
        ("1 A w: +10 -2 +nan 0 36 54 1", "action 0 is"),
        ("١ A w: +10 -2 +20 0 36 54 1", "action 0 is"),  # noqa: RUF001 (an Arabic one)
        (f"{ROW}; 2 B w: +0 +0 +4", "action 1 is"),
        ("; ".join(f"{k} B w: +0 +0 +4 36 36 36 0" for k in range(1, 27)), "26 actions, more than 25"),
        ("x" * 100_001, "longer than 100000"),
    ],
)
def test_refused_replies_carry_their_text(reply_text, message):
    with pytest.raises(ReplyParseError) as caught:
        parse_reply(reply_text, codec_for(2), [CUP, PLATE], INSTRUCTION)
    assert message in caught.value.message
    assert len(caught.value.message) < 250
    assert caught.value.reply_text == reply_text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f" {ROW}\n", False),
        (f" {ROW}; {ROW_2}\n", True),
        (f" {ROW}; {ROW_2}; 3 B w: -199 +12 -999 71 9 60 1\n", True),
        (f" {ROW}; {ROW_2}; 3 B w: +0 +0 +4 36 36 36 0; 4 B w: +0 +0 +4 36 36 36 0\n", False),
        (f" {ROW}; {ROW_2}; 2 B w: +0 +0 +4 36 36 36 0\n", False),
        (f"{ROW}; {ROW_2}\n", False),
        (f" {ROW}; 2 B o: +0 +0 +4 36 36 36 0\n", False),
        (f" {ROW}; 2 B w: 0 +0 +4 36 36 36 0\n", False),
        (f" {ROW}; 2 B w: +00 +0 +4 36 36 36 0\n", False),
        (f" {ROW}; 2 B w: +0 +0 +4 36 36 36 2\n", False),
        ("", False),
    ],
)
def test_the_grammar_knows_numbers_letters_frames_and_the_number_of_rows(text, expected):
    """Where demonstrations of two clauses are all there is, it is unknown which of their rows one clause has."""
    assert matches(grammar_of(codec_for(4, 6, instruction=TWO_CLAUSES), INSTRUCTION), text) is expected


@pytest.mark.parametrize("counts", [(1,), (1, 4), (3, 2, 2), (12,)])
@pytest.mark.parametrize("instruction", [INSTRUCTION, "take the red cup, then put it on the plate"])
def test_every_text_follows_the_grammar_of_its_own_demonstrations(counts, instruction):
    codec = codec_for(*counts, instruction=instruction)
    for shown, count in zip(codec.demonstrations, counts, strict=True):
        text = codec.actions_text(shown)
        assert text.count(":") == count
        assert matches(grammar_of(codec, instruction), f" {text}\n")


def test_objects_of_unknown_rotation_only_offer_world_axes():
    objects = (pose("red cup", (0.1, 0.2, 0.7)), PLATE)
    grammar = grammar_of(codec_for(4, objects=objects, instruction=TWO_CLAUSES), INSTRUCTION)
    assert not matches(grammar, f" {ROW}; {ROW_2}\n")
    assert matches(grammar, f" {ROW.replace(' o:', ' w:')}; {ROW_2}\n")
