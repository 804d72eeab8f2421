"""Findings as pages list them."""

import re
from pathlib import Path

import pytest

from app.pipeline.finding import Finding
from app.web import page
from app.web.page import linked

PARTS = "".join(path.read_text() for path in (Path(page.__file__).parent / "templates").glob("prediction*.html"))
SHOWN = '{% from "macros.html" import findings %}{{ findings("/below", found, linked=true) }}'
WHERE = ("objects[cube]", "actions[0]", "end_effector", "keyframes", "trajectory.gripper_open", "demonstrations")


@pytest.mark.parametrize("where", [*WHERE, "instruction", "reply"])
def test_a_finding_leads_to_its_evidence(where):
    html = page._ENVIRONMENT.from_string(SHOWN).render(found=[Finding("odd", "danger", "x", where)])
    part = re.search(r'href="#([\w-]+)"', html)[1]
    assert f'id="{part}"' in PARTS


def test_the_gravest_finding_is_first():
    found = [Finding(severity, severity, "x", "") for severity in ("info", "danger", "warning")]
    html = page._ENVIRONMENT.from_string(SHOWN).render(found=found)
    assert re.findall(r'<li class="(\w+)">', html) == ["danger", "warning", "info"]


def test_the_episodes_that_a_finding_names_are_links():
    id_ = "be725141ee064faaa92d0082029b45f9"
    shown = linked(f"<b> differs: {id_} and 2 more", "/below")
    assert shown == f'&lt;b&gt; differs: <a class="mono" href="/below/ui/episodes/{id_}">be725141</a> and 2 more'
