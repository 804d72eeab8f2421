"""After short hostile sequences of requests a robot does not move as no demonstration supports, unless it is warned."""

import pytest

import tests.attack.hostile_skills  # noqa: F401  # its sequences are listed when it is imported
from tests.attack.hostile_sequences import ARM, BLUE, PICK_RED, RED, SEQUENCES, Attack, moves_wrongly, pick

# What still moves a robot wrongly with status 200 and no danger, with the reason; a sequence that no longer does leaves
# this list.
WRONG: dict[str, str] = {}


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


@pytest.mark.parametrize("contradicting", [False, True])
def test_a_closed_loop_goes_on_to_its_end_and_each_step_has_the_doubts_about_demonstrations(http, contradicting):
    """Objects are tracked without their rotations."""
    attack = Attack(http)
    for k in range(6):
        places = attack.places(RED, BLUE)
        of = BLUE if contradicting and k % 2 else RED
        attack.teach(PICK_RED, places, pick(places[of]), tracked=True)
    places, options = attack.places(RED, BLUE), {"closed_loop": True}
    for number in (1, 1, 1, 0):  # approach, grasp, lift, done
        answer = attack.ask(PICK_RED, places, end_effector=ARM, **options)
        assert answer.status_code == 200, answer.text
        document = answer.json()
        assert len(document["actions"]) == number
        assert ("danger" in {finding["severity"] for finding in document["findings"]}) == contradicting
        options["after"] = document["id"]
