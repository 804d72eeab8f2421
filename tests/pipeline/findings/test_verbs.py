"""Instructions that no rule about verbs can compare with a recording."""

import pytest
from app.pipeline.findings.recording import verb_findings

from app.pipeline.order.order import Order


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("the robot puts the cube on the plate", []),
        ("reach the cube", []),
        ("lege cube auf plate", ["unknown-verb"]),
        ("dunk the cube", ["unknown-verb"]),
        ("cube, plate", ["unknown-verb"]),
    ],
)
def test_unknown_verbs_are_reported_at_the_upload(instruction, expected):
    found = list(verb_findings(Order(instruction, ("cube", "plate"))))
    assert [item.code for item in found] == expected
    assert {item.severity for item in found} <= {"info"}
