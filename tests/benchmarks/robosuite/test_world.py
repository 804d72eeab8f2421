"""robosuite as a world, as far as it is ours: experts' poses, recordings of people, and the way of the arm."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.robosuite import expert, people, world
from benchmarks.robosuite.arm import ARRIVED_M, OPEN, Arm, gripper_open
from benchmarks.robosuite.scene import TASKS
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

HOME_M, HOME = np.array([-0.1, 0.0, 1.0]), Rotation.from_euler("z", np.pi / 2) * expert.DOWN
STEP_M = 0.02


class FreeHand:
    """A hand that comes where it is sent, in small steps; the scene is solved when it has let go."""

    def __init__(self, objects):
        self.hand_m, self.hand, self.width_m = HOME_M, HOME, 0.08
        self.joint_velocities_rad_s = np.full(7, 0.1)
        self.steps, self.done, self._objects = 0, False, objects

    ended = property(lambda self: self.done or self.steps > 500)

    def objects(self):
        return self._objects

    def off(self, target_m, target):
        return float(np.linalg.norm(target_m - self.hand_m)), float((target * self.hand.inv()).magnitude())

    def step(self, target_m, target, gripper, fastest=1.0):
        way_m = target_m - self.hand_m
        self.hand_m = self.hand_m + way_m * min(1.0, STEP_M / max(np.linalg.norm(way_m), 1e-9))
        self.hand, self.steps = target, self.steps + 1
        self.width_m = float(np.clip(self.width_m + (0.01 if gripper == OPEN else -0.01), 0.03, 0.08))


def turned(name, position_m, yaw_deg):
    return ObjectPose(name, np.array(position_m), Rotation.from_euler("z", yaw_deg, degrees=True).as_quat())


def nut_scene(yaw_deg):
    return FreeHand((turned("square nut", [-0.11, 0.15, 0.83], yaw_deg), turned("peg", [0.23, 0.1, 0.85], 0)))


@pytest.mark.parametrize(("yaw_deg", "handle_deg"), [(10, 90), (-10, -90), (122, 90), (150, 180), (-150, 180)])
def test_the_nut_comes_onto_the_peg_with_its_handle_where_the_arm_can_hold_it(yaw_deg, handle_deg):
    scene = nut_scene(yaw_deg)
    released = expert.plan("square_nut", scene)[-1]
    peg = scene.objects()[1]
    toward_m = released.position_m[:2] - peg.position_m[:2]
    off_deg = np.degrees(np.arctan2(toward_m[1], toward_m[0])) - handle_deg
    assert abs((off_deg + 180) % 360 - 180) < 1e-6


@pytest.mark.parametrize("yaw_deg", [-80, 0, 30, 170])
def test_the_nut_is_turned_with_the_hand_that_holds_it(yaw_deg):
    _, _, grasp, _, _, placed, *_ = expert.plan("square_nut", nut_scene(yaw_deg))
    turn = Rotation.from_quat(placed.quaternion_xyzw) * Rotation.from_quat(grasp.quaternion_xyzw).inv()
    at_rest_deg = yaw_deg + np.degrees(turn.as_rotvec()[2])
    assert abs((at_rest_deg + 45) % 90 - 45) < 1e-6


@pytest.mark.parametrize("yaw_deg", [-120, -40, 44, 90, 179])
def test_a_cube_is_grasped_square_to_its_sides_with_the_least_turn(yaw_deg):
    grasp = expert.plan("lift", FreeHand((turned("cube", [0, 0, 0.82], yaw_deg),)))[1]
    hand = Rotation.from_quat(grasp.quaternion_xyzw)
    assert np.degrees((hand * HOME.inv()).magnitude()) <= 45 + 1e-6
    relative_deg = np.degrees((expert.DOWN.inv() * hand).as_rotvec()[2])
    assert abs((relative_deg + yaw_deg + 45) % 90 - 45) < 1e-6


def test_the_arm_records_where_it_was_and_when_its_fingers_had_opened():
    arm = Arm(FreeHand(()))
    there_m = HOME_M + np.array([0.1, 0.0, -0.1])
    arm.carry_out([EndEffectorAction(there_m, HOME.as_quat(), is_open) for is_open in (True, False, True)])
    trajectory = arm.trajectory()
    np.testing.assert_allclose(trajectory.positions_m[[0, -1]], [HOME_M, there_m], atol=ARRIVED_M)
    assert np.count_nonzero(np.diff(trajectory.gripper_open)) == 2
    assert trajectory.gripper_open[-1]


def test_fingers_around_a_thing_are_closed():
    assert gripper_open(np.array([0.08, 0.08, 0.05, 0.04])).tolist() == [True, True, False, False]


def recorded(folder, name, **changed):
    frames = 40
    places_m = np.tile([0.45, 0.1, 1.0], (frames, 1))
    data = {
        "timestamps": np.arange(frames) / 20,
        "end_effector_positions": places_m,
        "end_effector_quaternions_xyzw": np.tile([1.0, 0, 0, 0], (frames, 1)),
        "joint_velocities": np.zeros((frames, 7)),
        "gripper_width_m": np.linspace(0.08, 0.04, frames),
        "object_names": np.array(["cubeB", "cubeA"]),
        "object_positions": np.tile([[[0.6, 0, 0.82]], [[0.5, 0, 0.82]]], (1, frames, 1)),
        "object_quaternions_xyzw": np.tile([[[0.0, 0, 0, 1]]], (2, frames, 1)),
        "static_names": np.array(["peg", "table"]),
        "static_positions": np.array([[0.7, 0, 0.85], [0.0, 0, 0.8]]),
    }
    np.savez(folder / name, **{**data, **changed})


def test_people_recorded_in_the_frame_of_another_arm_are_moved_into_the_table(tmp_path):
    recorded(tmp_path, "stack_panda_1.npz")
    recorded(tmp_path, "stack_sawyer_1.npz", static_positions=np.array([[0.7, 0, 0.85], [0.56, 0, 0.4]]))
    new, old = (people.recorded_by_people(tmp_path, "stack_by_people", number) for number in (0, 1))
    assert [pose.name for pose in new.scene.objects] == [body.name for body in TASKS["stack"].bodies]
    np.testing.assert_allclose(new.scene.objects[0].position_m, [0.5, 0, 0.82])
    np.testing.assert_allclose(old.scene.objects[0].position_m, [-0.06, 0, 0.82])
    np.testing.assert_allclose(old.trajectory.positions_m[0], [-0.11, 0.1, 1.0])


def test_tasks_of_people_are_there_where_their_folder_is(tmp_path):
    scripted = {name for name, task in TASKS.items() if task.scripted}
    assert set(world.Robosuite(None).tasks) == scripted
    assert set(world.Robosuite(tmp_path).tasks) == {*scripted, *people.PEOPLE}


def test_what_never_moves_stands_where_the_recording_has_it(tmp_path, monkeypatch):
    still = people.PeopleTask("stack", ("stack_panda_1.npz",), (("cubeA",), ("peg",)))
    monkeypatch.setitem(people.PEOPLE, "still", still)
    recorded(tmp_path, "stack_panda_1.npz")
    peg = people.recorded_by_people(tmp_path, "still", 0).scene.objects[1]
    np.testing.assert_allclose(peg.position_m, [0.7, 0, 0.85])
