"""Where the hand is before it moves: recordings that mean another point of it, or another frame, start elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.findings.demonstrated_scenes import ShownScenes
from app.pipeline.findings.frames import frame_findings, held_findings, start_findings
from app.pipeline.findings.hand import Kept, RecordedHand
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


@pytest.mark.parametrize(("off_m", "higher_now_m", "found"), [(0.0, 0, 0), (0.03, 0, 0), (0.08, 0, 1), (0.0, 0.08, 0)])
def test_robots_that_start_in_several_places_hide_no_flange(off_m, higher_now_m, found):
    """A hand that is higher now than recordings start is elsewhere: a flange would act nearer to objects."""
    random = np.random.default_rng(0)
    starts_m = [(*random.uniform(-0.03, 0.03, 2), random.uniform(-0.01, 0.01)) for _ in range(10)]
    recordings = [hand_off(put(seed), x_m, y_m, z_m + off_m) for seed, (x_m, y_m, z_m) in enumerate(starts_m)]
    now = home()
    place_m = np.add(now.position_m, [0, 0, higher_now_m])
    assert reported(recordings, Pose(place_m, now.quaternion_xyzw)) == found


@pytest.mark.parametrize(("number", "found"), [(1, 0), (3, 1)])
def test_some_recordings_of_the_flange_are_enough_where_they_are_more_than_a_third(number, found):
    recordings = [hand_off(put(seed), 0, 0, 0.08 * (seed < number)) for seed in range(6)]
    assert reported(recordings, home()) == found


@pytest.mark.parametrize(("off_m", "found"), [((0.03, 0), 0), ((0.08, 0), 1), ((-0.2, 0.1), 1)])
def test_recordings_of_another_frame_act_beside_objects_by_as_much_as_they_start_elsewhere(off_m, found):
    assert reported([hand_off(put(seed), *off_m, 0) for seed in range(4)], home()) == found


@pytest.mark.parametrize(("turned_deg", "found"), [(0, 0), (10, 0), (45, 1), (-90, 1), (180, 0)])
def test_recordings_of_a_turned_flange_start_turned_in_the_same_place(turned_deg, found):
    assert reported([put(seed) for seed in range(4)], home(turned_deg=turned_deg)) == found


def test_another_point_of_the_hand_turns_with_it():
    recordings = []
    for seed in range(6):
        given = put(seed)
        hands = Rotation.from_quat(given.motion.trajectory.quaternions_xyzw.copy())
        recordings.append(changed(given, positions_m=given.motion.trajectory.positions_m + hands.apply([0.05, 0, 0])))
    assert reported(recordings, home()) == 1


@pytest.mark.parametrize(("away_m", "number", "dangers"), [(0.3, 4, 1), (0.05, 4, 0), (0.3, 1, 0)])
def test_what_recordings_have_in_the_hand_from_the_start_must_be_there(away_m, number, dangers):
    recordings = [put(seed) for seed in range(4)]
    recordings[:number] = [frames(slice(86, None))(item) for item in recordings[:number]]  # once it is grasped
    scene, shown = recordings[0].demonstration, [item.demonstration for item in recordings]
    hands = [RecordedHand.of(item.motion, item.demonstration, Kept(0.0, 0.0)) for item in recordings]
    now = home()._replace(position_m=tuple(np.add(scene.object("red cube").position_m, (0, 0, away_m)).tolist()))
    assert [f.code for f in held_findings(now, scene, shown, hands)] == ["not-in-the-hand"] * dangers
    assert list(held_findings(None, scene, shown, hands)) == []


def test_a_closed_hand_that_starts_at_the_object_of_the_instruction_and_is_elsewhere_now():
    """Each recording is of another object, and the fist that pushes it never opens."""
    recordings = [changed(item, gripper_open=np.zeros(len(item.motion), bool)) for item in map(at_the_cube, range(4))]
    shown = [named(item, f"cube {k}") for k, item in enumerate(recordings)]
    hands = [RecordedHand.of(item.motion, one, Kept(0.0, 0.0)) for item, one in zip(recordings, shown, strict=True)]
    assert [f.code for f in held_findings(home(), shown[0], shown, hands)] == ["not-in-the-hand"]
    at_it = home()._replace(position_m=tuple(shown[0].objects[0].position_m.tolist()))
    assert list(held_findings(at_it, shown[0], shown, hands)) == []


def at_the_cube(seed):
    return frames(slice(85, None))(put(seed))


def named(item, name):
    cube, plate = item.demonstration.objects
    return replace(item.demonstration, instruction=f"push the {name}", objects=(replace(cube, name=name), plate))


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
