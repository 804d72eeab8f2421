"""Lists of rows that a reply with two or three valid rows must not be."""

import json


def wrong_lists(first, second):
    """From two valid rows, whose last number is 0 or 1, as texts."""
    one, two = json.loads(first), json.loads(second)
    return [
        [],
        [one],
        [one] * 4,
        [one, [*two[:-1], 2]],
        [one, [0.5, *two[1:]]],
        [one, [-100_000, *two[1:]]],
        [one, two[1:]],
        [one, [*two, 1]],
        {"actions": [one, two]},
    ]
