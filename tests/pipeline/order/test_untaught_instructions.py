"""Instructions of tasks that were not shown: only their objects are understood."""

import pytest

from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order.reading import read_untaught
from app.pipeline.order.taught import Taught
from app.services.predict.instruction import is_english

CUPS = Taught(("red cup", "blue cup", "cup holder"), {"cup holder": ("tree",)}, (), is_english)
LAPTOP = Taught(("laptop",), {}, (), is_english)


@pytest.mark.parametrize(
    ("said", "canonical", "objects"),
    [
        ("hang the red cup gently upon the cup holder", "hang the red cup gently upon the cup holder", 2),
        ("defenestrate the azure cup", "defenestrate the blue cup", 1),
        ("hang the red cup on the tree", "hang the red cup on the cup holder", 2),
        ("hang the red cup on the cup hodler", "hang the red cup on the cup holder", 2),
    ],
)
def test_untaught_words_pass_and_objects_have_their_names(said, canonical, objects):
    order = read_untaught(said, CUPS)
    assert order.text == canonical
    assert len(order.phrases) == objects
    assert order.unfamiliar is None


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("hang the green cup on the cup holder", "green cup' is none of"),
        ("hang the cup on the cup holder", "may be red cup, blue cup"),
        ("hang the red cup on the shelf", "the shelf' is none of"),
        ("do not hang the red cup", "what not to do"),
        ("hang it up", "names no object of the scene"),
        ("hang the red cup on the block", "block' is none of"),
        ("hang the red cup on the thing", "thing' may be red cup, blue cup"),
        ("turn the tap with the red cup", "tap' is none of"),
    ],
)
def test_what_it_mentions_must_be_in_the_scene(said, why):
    with pytest.raises(UngroundedInstructionError, match=why) as refused:
        read_untaught(said, CUPS)
    assert refused.value.field == "instruction"
    assert "red cup" in refused.value.valid
    assert "taught" not in refused.value.valid


def test_a_verb_is_no_thing():
    assert read_untaught("tap the red cup", CUPS).text == "tap the red cup"


def test_of_a_single_object_nothing_need_be_said():
    assert read_untaught("shut down", LAPTOP).text == "shut down"
    with pytest.raises(UngroundedInstructionError, match="cube' is none of"):
        read_untaught("pick up the cube", LAPTOP)
