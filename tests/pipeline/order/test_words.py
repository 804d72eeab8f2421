import pytest

from app.pipeline.order.forms import plurals_of, verb_forms
from app.pipeline.order.words import tokens_of


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Push the red_button.", ["push", "the", "red", "button", "."]),
        ("don't push 'red', push “blue”!", ["do", "not", "push", "red", ",", "push", "blue", "."]),
        (
            "the left-hand, bottom-most tap (not the other)",
            ["the", "left", "hand", ",", "bottommost", "tap", ",", "not", "the", "other"],
        ),
        ("I\u2019d like no. 5", ["i", "would", "like", "no", ".", "5"]),
        ("the cup's lid, anti-clockwise", ["the", "cup", "'s", "lid", ",", "counterclockwise"]),
    ],
)
def test_words_are_cut_out_and_contractions_written_out(text, words):
    assert [token.text for token in tokens_of(text)] == words


@pytest.mark.parametrize(
    ("verb", "form"),
    [("push", "pushes"), ("push", "pushing"), ("place", "placing"), ("tap", "tapped"), ("carry", "carries"),
     ("carry", "carried"), ("put", "putting"), ("close", "closed"), ("lift", "lifted")],
)  # fmt: skip
def test_regular_forms_of_verbs(verb, form):
    assert form in verb_forms(verb)


@pytest.mark.parametrize(
    ("plural", "singular"),
    [("mugs", "mug"), ("boxes", "box"), ("berries", "berry"), ("loaves", "loaf"), ("knives", "knife")],
)
def test_plurals(plural, singular):
    assert plural in plurals_of(singular)
    assert singular not in plurals_of(plural)
