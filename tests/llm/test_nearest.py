import pytest

from app.llm.base import ModelResponseError
from app.llm.baselines import copied_reply

LIFT = "".join(f"cup {x} 50; lift it > 1 cup w: +0 +0 +{x}\n" for x in (10, 20, 30))
DROP = "cup 24 50; drop it > 1 cup w: +0 +0 -5\n"


def test_the_nearest_of_those_that_carry_out_the_instruction_is_copied():
    assert copied_reply(LIFT + DROP, "cup 24 50; lift it >") == " 1 cup w: +0 +0 +20"
    assert copied_reply(LIFT + DROP, "cup 29 51; drop it >") == " 1 cup w: +0 +0 -5"


def test_an_instruction_never_shown_falls_to_the_nearest_of_all():
    assert copied_reply(LIFT + DROP, "cup 25 50; shake it >") == " 1 cup w: +0 +0 -5"


def test_clauses_that_were_answered_already_stand_before_the_query():
    answered = "cup 24 50; drop it > 1 cup w: +0 +0 -5\n"
    assert copied_reply(LIFT + DROP, f"{answered}cup 24 50; lift it >") == " 1 cup w: +0 +0 +20"


def test_of_a_closed_loop_the_step_that_is_asked_for_is_copied():
    """Not what was done a moment ago, though that scene is the nearest."""
    steps = "cup {0} 50 > 1 cup w: +0 +0 +{0}\ncup {0} 51 > 2 cup w: +1 +0 +{0}\ncup {0} 52 > done\n"
    prefix, so_far = steps.format(10) + steps.format(30), "cup 12 50 > 1 cup w: +0 +0 +10\n"
    assert copied_reply(prefix, "cup 12 50 >") == " 1 cup w: +0 +0 +10"
    assert copied_reply(prefix, f"{so_far}cup 12 50 >") == " 2 cup w: +1 +0 +10"
    assert copied_reply(prefix, f"{so_far}cup 12 50 > 2 cup w: +1 +0 +10\ncup 12 50 >") == " done"


def test_the_papers_format():
    prefix = "{'cup': [10, 20], 'lift'}>[[1, 2, 3, 0, 39, 0, 1]], {'cup': [40, 20], 'lift'}>[[4, 2, 3, 0, 39, 0, 1]], "
    assert copied_reply(prefix, "{'cup': [33, 20], 'lift'}>") == "[[4, 2, 3, 0, 39, 0, 1]]"


@pytest.mark.parametrize("prefix", ["", "no demonstration", "cup 1 2 3; lift it > 1 cup w: +0\n"])
def test_a_prompt_that_it_cannot_use_is_an_error(prefix):
    with pytest.raises(ModelResponseError):
        copied_reply(prefix, "cup 25 50; lift it >")
