"""After short hostile sequences of requests a robot does not move as no demonstration supports, unless it is warned."""

import pytest

from tests.attack.hostile_sequences import SEQUENCES, Attack, moves_wrongly

# What still moves a robot wrongly with status 200 and no danger; a sequence that no longer does leaves this list.
WRONG = {
    "alias_in_the_plural": "an alias in the plural names another object",
    "two_ways_of_three_recordings": "two of three are one way, and one is a rare plan",
    "two_ways_those_of_one_named": "ids that a request names count as a person's choice",
    "two_ways_with_a_switch_in_a_closed_loop": "a step of a closed loop has no finding about demonstrations",
    "a_side_decides_which_of_two": "the larger half decides, and the other is left out without a word",
    "a_side_decides_and_the_base_was_turned_round": "the larger half decides",
    "keyframes_too_far_apart": "keyframes by the task's rule miss the grasp",
    "presses_with_a_wide_tolerance": "keyframes by the task's rule miss the lowest point",
    "declared_round_after_teaching": "rows that scatter by the radius of the declared symmetry are a warning",
}


def cases():
    for number, tried in enumerate(SEQUENCES):
        marks = [pytest.mark.long] if number % 5 else []  # `make attack` has all
        if reason := WRONG.get(tried.__name__):
            marks.append(pytest.mark.xfail(reason=reason))
        yield pytest.param(tried, id=tried.__name__, marks=marks)


@pytest.mark.parametrize("tried", [*cases()])
def test_no_motion_that_no_demonstration_supports_without_a_danger(http, tried):
    answer, goal = tried(Attack(http))
    assert answer.status_code < 500 or answer.json()["type"] != "/problems/internal", answer.text
    assert not moves_wrongly(answer, goal), answer.text


def test_there_are_sixty_sequences_each_by_one_name_and_all_that_move_wrongly_are_among_them():
    names = [tried.__name__ for tried in SEQUENCES]
    assert len(names) >= 60
    assert len({*names}) == len(names)
    assert {*WRONG} <= {*names}
