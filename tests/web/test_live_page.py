"""The page Now with a robot under way, and its Stop."""

from uuid import uuid4

import pytest
from playwright.sync_api import expect

from tests.web.conftest import INSTRUCTION, wait_until

HERE = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0]}
SAID = {"task": "pick", "instruction": INSTRUCTION, "end_effector": HERE}


@pytest.fixture
def run(http, seeded):
    address = f"/runs/{uuid4().hex}"
    http.put(address, json=SAID).raise_for_status()
    yield address
    http.delete(address)


def test_a_robot_is_seen_and_stopped(page, http, run, check_accessibility):
    page.goto("/ui/live")
    card = page.locator(".robot")
    expect(card).to_contain_text("waits for its actions")
    check_accessibility(page)
    prediction = http.get("/predictions", params={"task": "pick", "limit": 1}).json()["predictions"][0]
    http.put(run, json={**SAID, "action": 2, "prediction_id": prediction["id"]}).raise_for_status()
    expect(card).to_contain_text(f"action 2 of {len(prediction['actions'])}")
    assert card.locator(".gripper.hand").count() == 1
    page.get_by_role("button", name=f"Stop the robot: {INSTRUCTION}").press("Enter")
    wait_until(lambda: http.put(run, json=SAID).json() == {"stop": True}, "the robot gets it")
    expect(card.get_by_role("button", name="Stop the robot")).to_be_disabled()
    http.delete(run)
    expect(card).to_have_count(0)
    expect(page.locator("#runs")).to_contain_text("No robot has reported a run within the last minute")
