"""Where the hand is before it moves: recordings that mean another point of it, or another frame, start elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.demonstrated_scenes import ShownScenes
from app.pipeline.findings.frames import frame_findings, held_findings, start_findings
from app.pipeline.findings.hand import Kept, RecordedHand
from scipy.spatial.transform import Rotation

from roboprompt_client.types.poses import Pose
from tests.pipeline.findings.test_implausible import changed, frames, put
from tests.pipeline.scenes import action, demonstration, pose

STEEP_DEG = 40


def reported(recordings, now):
    """The dangers of recordings if the hand is now where the right ones start, or `now`."""
    shown = [item.demonstration for item in recordings]
    hands = [RecordedHand.of(item.motion, item.demonstration, Kept(0.0, 0.0)) for item in recordings]
    findings = list(frame_findings(now, shown, hands))
    assert all(item.code == "hand-in-another-frame" and item.severity == "danger" for item in findings)
    return len(findings)


def home(tilted_deg=0.0, turned_deg=0.0):
    first = put(0).motion.trajectory
    turn = Rotation.from_euler("zx", [turned_deg, tilted_deg], degrees=True)
    turn *= Rotation.from_quat(first.quaternions_xyzw[0].copy())
    return Pose(tuple(first.positions_m[0].tolist()), tuple(turn.as_quat().tolist()))


def hand_off(item, *off_m):
    return changed(item, positions_m=item.motion.trajectory.positions_m + np.array(off_m))


@pytest.mark.parametrize(("off_m", "found"), [(0.0, 0), (0.03, 0), (0.06, 1), (-0.1, 1)])
def test_recordings_of_the_flange_are_recognized_by_where_they_start(off_m, found):
    assert reported([hand_off(put(seed), 0, 0, off_m) for seed in range(4)], home()) == found


@pytest.mark.parametrize(("off_m", "found"), [((0.03, 0), 0), ((0.08, 0), 1), ((-0.2, 0.1), 1)])
def test_recordings_of_another_frame_act_beside_objects_by_as_much_as_they_start_elsewhere(off_m, found):
    assert reported([hand_off(put(seed), *off_m, 0) for seed in range(4)], home()) == found


@pytest.mark.parametrize(("turned_deg", "found"), [(0, 0), (10, 0), (45, 1), (-90, 1), (180, 0)])
def test_recordings_of_a_turned_flange_start_turned_in_the_same_place(turned_deg, found):
    assert reported([put(seed) for seed in range(4)], home(turned_deg=turned_deg)) == found


@pytest.mark.parametrize(("away_m", "number", "dangers"), [(0.3, 4, 1), (0.05, 4, 0), (0.3, 1, 0)])
def test_what_recordings_have_in_the_hand_from_the_start_must_be_there(away_m, number, dangers):
    recordings = [put(seed) for seed in range(4)]
    recordings[:number] = [frames(slice(86, None))(item) for item in recordings[:number]]  # once it is grasped
    scene, shown = recordings[0].demonstration, [item.demonstration for item in recordings]
    hands = [RecordedHand.of(item.motion, item.demonstration, Kept(0.0, 0.0)) for item in recordings]
    now = home()._replace(position_m=tuple(np.add(scene.object("red cube").position_m, (0, 0, away_m)).tolist()))
    assert [f.code for f in held_findings(now, scene, shown, hands)] == ["not-in-the-hand"] * dangers
    assert list(held_findings(None, scene, shown, hands)) == []


def test_a_hand_that_is_elsewhere_is_right():
    recordings = [put(seed) for seed in range(4)]
    at_home = home()
    for away_m in ((0.1, 0, 0), (0, -0.3, 0.2), (0.05, 0.05, -0.1)):
        place_m = tuple(np.add(at_home.position_m, away_m).tolist())
        assert reported(recordings, at_home._replace(position_m=place_m)) == 0
    assert reported(recordings, None) == 0
    assert reported([hand_off(item, 0, 0, 0.08) for item in recordings], home(tilted_deg=STEEP_DEG)) == 0


@pytest.mark.parametrize(("off_m", "severity"), [(0.0, []), (0.07, []), (0.17, ["warning"]), (-0.4, ["danger"])])
def test_a_hand_that_starts_elsewhere_than_demonstrations(off_m, severity):
    cube = (pose("red cube", (0.1, 0.0, 0.8)),)
    unknown = [demonstration("push the red cube", cube, []) for _ in range(10)]
    shown = [replace(item, start=action((0.3, 0.02 * k, 1.1))) for k, item in enumerate(unknown)]
    now = Pose.of(action((0.3, 0.09, 1.1 + off_m)))
    findings = start_findings(now, ShownScenes(tuple(shown)))
    assert [finding.severity for finding in findings] == severity
    assert start_findings(now, ShownScenes(tuple(unknown))) == ()
