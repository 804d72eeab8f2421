"""Every instruction of the simulated tasks is understood as it stands, also those that no demonstration shows."""

import pytest

from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.sim.tasks import ALL_TASKS, TASKS, make_task

MAX_VARIATIONS = 100  # of a task; they are drawn evenly


def words_of(name):
    task = ALL_TASKS[name]
    taught = [make_task(name, 0, k).instruction for k in range(task.variations)]
    return TaughtWords(task.object_names, {}, taught), taught


@pytest.mark.parametrize("name", TASKS)
def test_demonstrated_and_tested_instructions_are_taken_literally(name):
    task, (words, _) = TASKS[name], words_of(name)
    number = task.variations + task.test_only_variations
    asked = {make_task(name, 0, k).instruction for k in range(0, number, max(1, number // MAX_VARIATIONS))}
    asked |= {make_task(name, 0, task.test_variation(seed)).instruction for seed in range(8)}
    assert {said: read(said, words).text for said in asked} == {said: said for said in asked}


PARAPHRASES = {
    "push_button": "press the azure button",
    "push_multiple_buttons": "first press the red button, then the green one",
    "stack_cube": "put the blue cube on top of the yellow one",
    "open_drawer": "pull open the bottom drawer, please",
    "destack_cube": "unstack the blue cube that is on the yellow cube",
    "stack_blocks": "stack two red blocks on the green platform",
    "meat_off_grill": "remove the chicken from the grill",
    "stack_cups": "put the blue cup and the red cup inside the green cup",
    "close_laptop": "shut the laptop",
    "slide_block": "push the block onto the green target",
    "turn_tap": "rotate the left tap",
    "put_in_safe": "put the money in the safe",
    "sweep_to_dustpan": "brush the dirt into the dustpan",
    "put_in_drawer": "place the block into the bottom drawer",
    "put_in_cupboard": "insert the crackers into the cupboard",
}
OTHER_WORDS = {
    "open_drawer": "open the top drawer",
    "put_in_safe": "put the money away in the safe on the top shelf",
    "turn_tap": "turn the right tap",
    "close_laptop": "open the laptop",
    "stack_blocks": "stack 3 red blocks on the green platform",
    "place_wine": "stack the wine bottle to the left of the rack",
    "sweep_to_dustpan": "sweep the crumbs to the dustpan",
}


@pytest.mark.parametrize("name", PARAPHRASES)
def test_a_paraphrase_is_understood(name):
    words, taught = words_of(name)
    canonical = read(PARAPHRASES[name], words).text
    expected = {
        "push_multiple_buttons": "push the red button, then push the green button",
        "stack_cups": "stack the blue cup and the red cup inside the green cup",
    }
    assert canonical == expected.get(name) or canonical in taught


@pytest.mark.parametrize("name", OTHER_WORDS)
def test_what_no_demonstration_shows_is_refused(name):
    words, _ = words_of(name)
    with pytest.raises(ValueError, match=r"^instruction: "):
        read(OTHER_WORDS[name], words)
