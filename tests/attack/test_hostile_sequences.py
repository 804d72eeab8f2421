"""After short hostile sequences of requests a robot does not move as no demonstration supports, unless it is warned."""

import pytest

import tests.attack.hostile_skills  # noqa: F401  # its sequences are listed when it is imported
from tests.attack.hostile_cells import CONTROLS
from tests.attack.hostile_sequences import SEQUENCES, Attack, moves_wrongly

# What still moves a robot wrongly with status 200 and no danger, with the reason; a sequence that no longer does leaves
# this list.
WRONG = {
    "peg_with_a_key_said_to_be_square": "a person declares it, and demonstrations within 40 degrees agree",
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
    if tried.__name__ in CONTROLS:
        assert answer.json()["actions"], answer.text
        assert all(finding["severity"] != "danger" for finding in answer.json()["findings"]), answer.text


def test_there_are_sixty_sequences_each_by_one_name_and_all_that_move_wrongly_are_among_them():
    names = [tried.__name__ for tried in SEQUENCES]
    assert len(names) >= 60
    assert len({*names}) == len(names)
    assert {*WRONG} <= {*names}
