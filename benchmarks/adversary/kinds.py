"""Every kind of case by name: what makes it wrong, or, of the right ones, what is different all the same."""

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.adversary import objects, people, recorder, recordings, streams, whole
from benchmarks.adversary.case import Mutation
from benchmarks.adversary.objects import in_question, of_recordings
from benchmarks.adversary.recordings import Fault, in_all, in_half, in_one, in_some

ESTIMATOR_M = 0.0168  # the average error of the paper's pose estimator


@dataclass(frozen=True)
class Kind:
    """A kind of case.

    Attributes:
        mutation: what becomes of a case in which nothing is wrong.
        wrong: whether the robot should not move by it unless the scene is solved all the same.
        contradictory: whether what is sent contradicts itself. Where it does not, e.g. where an object is seen at
            another place where it might be, nothing but another sensor could tell.
    """

    mutation: Mutation
    wrong: bool = True
    contradictory: bool = True


def _plausible(mutation: Mutation) -> Kind:
    return Kind(mutation, contradictory=False)


def _right(mutation: Mutation) -> Kind:
    return Kind(mutation, wrong=False)


def _half_and_all(name: str, fault: Fault, *, contradictory: bool = False) -> dict[str, Kind]:
    """A fault of half of the recordings, and of all, which then agree unless it is `contradictory` in itself."""
    of_all = Kind(in_all(fault), contradictory=contradictory)
    return {f"{name} in half": Kind(in_half(fault)), f"{name} in all": of_all}


RIGHT: Mapping[str, Kind] = {
    "unchanged": _right(whole.unchanged),
    "poses 0.5 cm off": _right(in_all(of_recordings(objects.noisy(0.005)))),
    "poses as the estimator gives them": _right(in_all(of_recordings(objects.noisy(ESTIMATOR_M)))),
    "scene 0.5 cm off": _right(in_question(objects.noisy(0.005))),
    "five recordings": _right(whole.fewer_recordings(5)),
    "three asked for": _right(whole.asking(whole.unchanged, num_demonstrations=3, selection="nearest")),
    "objects in another order": _right(whole.objects_in_another_order),
    "hand elsewhere": _right(whole.hand_elsewhere),
    "turned within symmetry": _right(whole.turned_within_symmetry),
    "hand trembles": _right(in_all(people.trembling)),
    "hand waits on its way": _right(in_all(people.waiting)),
    "each at its own speed": _right(in_all(people.at_its_own_speed)),
    "fingers close again in some": _right(in_some(people.grasping_again)),
    "hand strays": _right(in_all(people.straying)),
}
WRONG: Mapping[str, Kind] = {
    "frame moved in half": Kind(in_half(recordings.frame_moved)),
    "hand shifted in half": Kind(in_half(recordings.hand_shifted)),
    "hand shifted in all": _plausible(in_all(recordings.hand_shifted)),
    "hand shifted in one": Kind(in_one(recordings.hand_shifted)),
    "hand turned in half": Kind(in_half(recordings.hand_turned)),
    "hand turned in all": Kind(in_all(recordings.hand_turned)),
    "hand lifted in half": Kind(in_half(recordings.hand_lifted)),
    "hand lifted in all": _plausible(in_all(recordings.hand_lifted)),
    "mirrored in half": Kind(in_half(recordings.mirrored)),
    "hand mirrored in half": Kind(in_half(recordings.hand_mirrored)),
    "hand mirrored in all": Kind(in_all(recordings.hand_mirrored)),
    "hand in millimeters in half": Kind(in_half(recordings.hand_in_millimeters)),
    "gripper inverted in half": Kind(in_half(recordings.gripper_inverted)),
    "gripper inverted in one": Kind(in_one(recordings.gripper_inverted)),
    "gripper inverted in all": _plausible(in_all(recordings.gripper_inverted)),
    "w first in half": Kind(in_half(recordings.quaternions_wxyz)),
    "w first in all": _plausible(in_all(recordings.quaternions_wxyz)),
    "objects' w first in half": Kind(in_half(of_recordings(objects.wxyz))),
    "reversed in half": Kind(in_half(recordings.reversed_in_time)),
    "reversed in one": Kind(in_one(recordings.reversed_in_time)),
    "reversed in all": _plausible(in_all(recordings.reversed_in_time)),
    "broken off in half": Kind(in_half(recordings.broken_off)),
    "broken off in all": _plausible(in_all(recordings.broken_off)),
    "another task's motion in half": Kind(in_half(recordings.of_another_task)),
    "another task's motion in one": Kind(in_one(recordings.of_another_task)),
    "another task's motion in all": Kind(in_all(recordings.of_another_task)),
    "another task in half": Kind(in_half(recordings.with_objects_of_another_task)),
    "another task in all": _plausible(in_all(recordings.with_objects_of_another_task)),
    "names swapped in half": Kind(in_half(of_recordings(objects.swapped))),
    "names swapped in one": Kind(in_one(of_recordings(objects.swapped))),
    "names swapped in question": _plausible(in_question(objects.swapped)),
    "name in capitals in question": Kind(in_question(objects.renamed(str.upper))),
    "name underscored in half": Kind(in_half(of_recordings(objects.renamed(objects.underscored)))),
    "name hyphenated in question": Kind(in_question(objects.renamed(objects.hyphenated))),
    "name twice in question": Kind(in_question(objects.duplicated(str))),
    "name twice, one capitalized": Kind(in_question(objects.duplicated(str.capitalize))),
    "name twice, one underscored": Kind(in_question(objects.duplicated(objects.underscored))),
    "objects of the next in one": Kind(whole.objects_of_the_next(0.1)),
    "objects of the next in half": Kind(whole.objects_of_the_next(0.5)),
    "objects of the next in all": Kind(whole.objects_of_the_next(1.0)),
    "object 2 to 5 cm off in half": Kind(in_half(of_recordings(objects.shifted(0.02, 0.05)))),
    "object 5 to 20 cm off in half": Kind(in_half(of_recordings(objects.shifted(0.05, 0.2)))),
    "object 20 to 70 cm off in half": Kind(in_half(of_recordings(objects.shifted(0.2, 0.7)))),
    "object 2 to 5 cm off in question": _plausible(in_question(objects.shifted(0.02, 0.05))),
    "object 5 to 20 cm off in question": _plausible(in_question(objects.shifted(0.05, 0.2))),
    "object 20 to 70 cm off in question": Kind(in_question(objects.shifted(0.2, 0.7))),
    "object 0.7 to 2.5 m off in question": Kind(in_question(objects.shifted(0.7, 2.5))),
    "object 2 to 6 cm higher or lower in question": Kind(in_question(objects.lifted(0.02, 0.06))),
    "object 10 to 70 cm higher or lower in question": Kind(in_question(objects.lifted(0.1, 0.7))),
    "object's height scaled in half": Kind(in_half(of_recordings(objects.height_scaled))),
    "object's height scaled in question": Kind(in_question(objects.height_scaled)),
    "object upside down in question": Kind(in_question(objects.upside_down)),
    "object lying in question": Kind(in_question(objects.lying)),
    "object turned in question": _plausible(in_question(objects.turned)),
    "object turned in half": Kind(in_half(of_recordings(objects.turned))),
    "bystander moved in question": _plausible(in_question(objects.bystander_moved)),
    "tag moved in question": Kind(whole.tag_moved),
    "tag moved, nothing named": Kind(whole.main_hidden_behind_its_tag),
    "poses 5 cm off in all": Kind(in_all(of_recordings(objects.noisy(0.05)))),
    "scene 5 cm off": Kind(in_question(objects.noisy(0.05))),
    "scene of a recording": _plausible(whole.scene_of_a_recording),
    "two ways under one instruction": Kind(whole.one_instruction_for_two),
    "instructions exchanged in half": Kind(whole.instructions_exchanged),
    "declared round": Kind(whole.declared_round),
    "declared square": Kind(whole.declared_square),
    "workspace widened": Kind(whole.workspace_widened),
    "one asked for, hand shifted in half": Kind(whole.asking(in_half(recordings.hand_shifted), num_demonstrations=1)),
    "two asked for, hand shifted in half": Kind(whole.asking(in_half(recordings.hand_shifted), num_demonstrations=2)),
    "one asked for, gripper inverted in half": Kind(
        whole.asking(in_half(recordings.gripper_inverted), num_demonstrations=1)
    ),
    "one asked for, names swapped in half": Kind(
        whole.asking(in_half(of_recordings(objects.swapped)), num_demonstrations=1)
    ),
    "object seen where another is in question": Kind(in_question(objects.taken_for_another)),
    "hand's rotations inverted in half": Kind(in_half(recordings.hand_rotations_inverted)),
    "hand's rotations inverted in all": _plausible(in_all(recordings.hand_rotations_inverted)),
    "objects' rotations inverted in half": Kind(in_half(of_recordings(objects.rotations_inverted))),
    "objects' rotations inverted in all": _plausible(in_all(of_recordings(objects.rotations_inverted))),
    "objects seen after the motion in half": Kind(in_half(recordings.objects_after)),
    "objects seen after the motion in all": _plausible(in_all(recordings.objects_after)),
    "places scaled in half": Kind(in_half(of_recordings(objects.places_scaled))),
    "places scaled in question": _plausible(in_question(objects.places_scaled)),
    **_half_and_all("gripper late", recorder.gripper_late),
    **_half_and_all("gripper early", recorder.gripper_early),
    **_half_and_all("gripper stuck", recorder.gripper_stuck),
    **_half_and_all("hand smoothed", recorder.smoothed),
    **_half_and_all("begun late", recorder.begun_late),
    **_half_and_all("middle missing", recorder.middle_missing),
    **_half_and_all("few frames", recorder.sparse),
    **_half_and_all("hand in a tilted frame", recorder.hand_in_tilted_frame, contradictory=True),
    **_half_and_all("hand with y up", recorder.hand_with_y_up, contradictory=True),
    **_half_and_all("hand scaled", recorder.hand_scaled),
    **_half_and_all("hand turned about itself", recorder.hand_turned_about_itself),
    **_half_and_all("hand misses", recorder.hand_misses),
    **_half_and_all("times in milliseconds", recorder.clock_in_milliseconds),
    **_half_and_all("joints at rest", recorder.joints_at_rest),
    **_half_and_all("joints in degrees", recorder.joints_in_degrees),
    **_half_and_all("joint positions as velocities", recorder.joint_positions),
    **_half_and_all("hand drifts", streams.drifting),
    **_half_and_all("hand frozen", streams.frozen),
    **_half_and_all("frames out of order", streams.out_of_order),
    **_half_and_all("hand's x and y exchanged", streams.axes_exchanged, contradictory=True),
    **_half_and_all("hand from its start", streams.from_its_start, contradictory=True),
    **_half_and_all("hand's rotation missing", streams.hand_unturned),
    **_half_and_all("not stopped", streams.not_stopped),
    **_half_and_all("objects in a camera's frame", of_recordings(objects.in_camera_frame), contradictory=True),
    "objects in a camera's frame in question": Kind(in_question(objects.in_camera_frame)),
    **_half_and_all("objects' rotations missing", of_recordings(objects.unturned)),
    "objects' rotations missing in question": _plausible(in_question(objects.unturned)),
}
KINDS: Mapping[str, Kind] = {**RIGHT, **WRONG}
