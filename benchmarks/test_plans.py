"""No request of the benchmark becomes a wrong plan, and most of the clear ones the right one."""

import json
from collections import Counter

from benchmarks.plans import ASKED, RIGHT, UNCLEAR, WRONG, answers


def test_no_request_becomes_a_wrong_plan():
    found = list(answers(json.loads(ASKED.read_text())))
    counts = Counter(answer.kind for answer in found)
    assert len(found) == 728
    assert [answer for answer in found if answer.kind == WRONG] == []
    assert counts[RIGHT] >= 0.6 * (counts[RIGHT] + counts[UNCLEAR])
