"""The yardsticks: `regression`, then `nearest`."""

import asyncio
import random

import pytest

from app.llm.base import ModelResponseError, complete
from app.llm.computed import copied_reply, regressed_reply, regression
from tests.llm.texts import absolute_prompt, asking


def absolute(objects, instruction="'push it'"):
    return "{" + ", ".join(f"'{name}': {list(bins)}" for name, bins in objects.items()) + f", {instruction}}}>"


def linear_prefix(num_demonstrations, seed=0, names=("drawer",)):
    """Each action 13 bins above, then 2 bins beside the last object; one object more or less to look at."""
    rng = random.Random(seed)
    text = ""
    for _ in range(num_demonstrations):
        objects = {name: [rng.randint(10, 90) for _ in range(3)] for name in names}
        x, y, z = objects[names[-1]]
        text += f"{absolute(objects)}[[{x}, {y}, {z + 13}, 0, 39, 0, 1], [{x + 2}, {y}, {z}, 0, 39, 0, 0]], "
    return text


@pytest.mark.parametrize("names", [("drawer",), ("lid", "jar"), ("cup 1", "cup 2")])
def test_a_linear_task_is_learned_exactly(names):
    query = absolute({name: [33 + k, 44, 55] for k, name in enumerate(names)})
    x = 33 + len(names) - 1
    expected = f"[[{x}, 44, 68, 0, 39, 0, 1], [{x + 2}, 44, 55, 0, 39, 0, 0]]"
    assert regressed_reply(linear_prefix(12, names=names), query) == expected


def test_the_object_frame_format_keeps_its_signs_and_row_numbers():
    rng = random.Random(1)
    prefix = ""
    for _ in range(6):
        x, y, yaw = rng.randint(10, 90), rng.randint(10, 90), rng.randint(28, 44)
        prefix += f"red button {x} {y} 17 {yaw}; push the red button > "
        prefix += f"1 red button w: +0 -3 +14 0 36 {yaw} 0; 2 red button o: +0 +0 +2 0 36 36 1\n"
    reply = regressed_reply(prefix, "red button 40 41 17 36; push the red button >")
    assert reply == " 1 red button w: +0 -3 +14 0 36 36 0; 2 red button o: +0 +0 +2 0 36 36 1"


def test_numbers_below_zero_without_plus_signs():
    prefix = "".join(f"{{'drawer': [{x}, 65]}}>[[{x - 30}, -4, 1]], " for x in (10, 20, 40, 50))
    assert regressed_reply(prefix, "{'drawer': [25, 65]}>") == "[[-5, -4, 1]]"
    assert regressed_reply(prefix, "{'drawer': [33, 65]}>") == "[[3, -4, 1]]"


def test_the_authors_format_without_an_instruction_is_read():
    prefix = "{'drawer': [42, 65, 29]}>[[42, 65, 55]], {'drawer': [40, 60, 20]}>[[40, 60, 46]], "
    assert regressed_reply(prefix, "{'drawer': [41, 62, 24]}>").startswith("[[4")


def test_demonstrations_with_the_querys_instruction_are_preferred():
    lift = "".join(f"cup {x} 50; lift it > 1 cup w: +{x} +0 +5\n" for x in (10, 20, 30, 40))
    drop = "".join(f"cup {x} 50; drop it > 1 cup w: +0 +{x} -5\n" for x in (10, 20, 30, 40))
    assert regressed_reply(lift + drop, "cup 25 50; lift it >") == " 1 cup w: +25 +0 +5"
    assert regressed_reply(lift + drop, "cup 25 50; drop it >") == " 1 cup w: +0 +25 -5"


def test_an_instruction_never_shown_falls_to_the_most_frequent_form():
    shown = "".join(f"cup {x} 50; lift it > 1 cup w: +0 +0 +5\n" for x in (10, 20, 30))
    other = "cup 10 50; drop it > 1 cup o: +1 +1 -5\n"
    assert regressed_reply(other + shown, "cup 25 50; shake it >") == " 1 cup w: +0 +0 +5"


def test_an_unsigned_number_never_becomes_negative_and_a_choice_stays_one():
    prefix = "".join(f"{{'a': [{x}]}}>[[{x - 10}, {int(x > 30)}]], " for x in (10, 20, 30, 40, 50))
    assert regressed_reply(prefix, "{'a': [2]}>") == "[[0, 0]]"
    assert regressed_reply(prefix, "{'a': [99]}>") == "[[89, 1]]"


@pytest.mark.parametrize(
    ("prefix", "reason"),
    [
        ("", "found 0 of 0"),
        (linear_prefix(1), "found 1 of 1"),
        ("once upon a time", "cannot be taken apart"),
        (linear_prefix(3) + "{'drawer': [1, 2", "cannot be taken apart"),
        ("cup 1 2 > 1 cup: +1\n" * 4, "found 0 of 4"),
    ],
)
def test_a_prompt_that_it_cannot_use_is_an_error(prefix, reason):
    with pytest.raises(ModelResponseError, match=reason):
        regressed_reply(prefix, absolute({"drawer": [1, 2, 3]}))


def test_the_backend_answers_the_services_prompt():
    completion = asyncio.run(complete(regression(), asking(absolute_prompt())))
    assert completion.text == "[[44, 55, 26, 0, 39, 0, 1], [44, 55, 17, 0, 39, 0, 0]]"
    assert completion.finish_reason == "stop"


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


def test_the_papers_format():
    prefix = "{'cup': [10, 20], 'lift'}>[[1, 2, 3, 0, 39, 0, 1]], {'cup': [40, 20], 'lift'}>[[4, 2, 3, 0, 39, 0, 1]], "
    assert copied_reply(prefix, "{'cup': [33, 20], 'lift'}>") == "[[4, 2, 3, 0, 39, 0, 1]]"


@pytest.mark.parametrize("prefix", ["", "no demonstration", "cup 1 2 3; lift it > 1 cup w: +0\n"])
def test_a_prompt_that_nearest_cannot_use_is_an_error(prefix):
    with pytest.raises(ModelResponseError):
        copied_reply(prefix, "cup 25 50; lift it >")
