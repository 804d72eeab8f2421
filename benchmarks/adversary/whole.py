"""What is wrong, or right, with a task as a whole: words, settings, options, and what stands beside its objects."""

from collections import Counter
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.adversary.case import Case, Mutation, Poses, Recording, mentioned
from benchmarks.adversary.recordings import all_moved, level
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

ONE_FOR_ALL = "do it"
TAG = "tag"


def asking(mutation: Mutation, **options: object) -> Mutation:
    """The same, asked with options of `POST /predict`."""

    def mutate(case: Case, random: np.random.Generator) -> Case | None:
        changed = mutation(case, random)
        return None if changed is None else replace(changed, options={**changed.options, **options})

    return mutate


def unchanged(case: Case, random: np.random.Generator) -> Case:
    """Nothing is wrong."""
    return case


def one_instruction_for_two(case: Case, random: np.random.Generator) -> Case | None:
    """Recordings of two instructions, one of them the one asked, come under one: `press the button`, left or right."""
    spoken = Counter(item.instruction for item in case.recordings)
    others = [words for words, _ in spoken.most_common() if words != case.instruction]
    if case.instruction not in spoken or not others:
        return None
    kept = [item for item in case.recordings if item.instruction in (case.instruction, others[0])]
    return replace(case, recordings=tuple(_said(item, ONE_FOR_ALL) for item in kept), instruction=ONE_FOR_ALL)


def instructions_exchanged(case: Case, random: np.random.Generator) -> Case | None:
    """Half of the recordings have the words of another one."""
    spoken = sorted({item.instruction for item in case.recordings})
    if len(spoken) < 2:
        return None
    following = dict(zip(spoken, [*spoken[1:], spoken[0]], strict=True))
    chosen = set(random.permutation(len(case.recordings))[: len(case.recordings) // 2].tolist())
    changed = (_said(r, following[r.instruction]) if k in chosen else r for k, r in enumerate(case.recordings))
    return replace(case, recordings=tuple(changed))


def objects_of_the_next(share: float) -> Mutation:
    """That share of the recordings (at least one) comes with the objects of the next one."""

    def mutate(case: Case, random: np.random.Generator) -> Case:
        number = len(case.recordings)
        chosen = set(random.permutation(number)[: max(1, round(share * number))].tolist())
        changed = tuple(
            replace(item, objects=case.recordings[(k + 1) % number].objects) if k in chosen else item
            for k, item in enumerate(case.recordings)
        )
        return replace(case, recordings=changed)

    return mutate


def scene_of_a_recording(case: Case, random: np.random.Generator) -> Case:
    """The robot reports the scene of a recording: its estimator shows an old picture."""
    return replace(case, objects=case.recordings[int(random.integers(len(case.recordings)))].objects)


def declared_round(case: Case, random: np.random.Generator) -> Case | None:
    """An object that is not round is declared so: its yaw means nothing then."""
    return _declared(case, 0.0)


def declared_square(case: Case, random: np.random.Generator) -> Case | None:
    """An object without symmetry is declared to look alike after a quarter turn."""
    return _declared(case, 90.0)


def tag_moved(case: Case, random: np.random.Generator) -> Case:
    """What stood 8 cm beside the first object in every recording, and no word names, is seen 7 to 18 cm elsewhere."""
    beside_m = level(random, 0.08, 0.08)
    recordings = tuple(replace(r, objects=_tagged(r.objects, case.main, beside_m)) for r in case.recordings)
    moved = _tagged(case.objects, case.main, beside_m)
    moved = (*moved[:-1], replace(moved[-1], position_m=moved[-1].position_m + level(random, 0.07, 0.18)))
    return replace(case, recordings=recordings, objects=moved)


def main_hidden_behind_its_tag(case: Case, random: np.random.Generator) -> Case | None:
    """As `tag_moved`, but the instruction names nothing, so that words do not tell what is acted on."""
    if len({item.instruction for item in case.recordings}) > 1 or mentioned(ONE_FOR_ALL, case.objects):
        return None
    tagged = tag_moved(case, random)
    recordings = tuple(_said(item, ONE_FOR_ALL) for item in tagged.recordings)
    return replace(tagged, recordings=recordings, instruction=ONE_FOR_ALL)


def workspace_widened(case: Case, random: np.random.Generator) -> Case:
    """One recording is 3 m away, and so is what is asked about."""
    far_m = level(random, 3.0, 3.0)
    first, *rest = case.recordings
    away = all_moved(first, far_m, Rotation.identity())
    asked = tuple(replace(pose, position_m=pose.position_m + 0.8 * far_m) for pose in case.objects)
    return replace(case, recordings=(away, *rest), objects=asked)


def fewer_recordings(number: int) -> Mutation:
    """So many recordings alone, of the asked instruction where there are."""

    def mutate(case: Case, random: np.random.Generator) -> Case:
        own = [item for item in case.recordings if item.instruction == case.instruction]
        rest = [item for item in case.recordings if item.instruction != case.instruction]
        return replace(case, recordings=tuple([*own, *rest][:number]))

    return mutate


def objects_in_another_order(case: Case, random: np.random.Generator) -> Case:
    """The robot reports the objects in another order."""
    return replace(case, objects=tuple(case.objects[k] for k in random.permutation(len(case.objects))))


def hand_elsewhere(case: Case, random: np.random.Generator) -> Case | None:
    """The hand begins up to 30 cm away from where recordings start, and up to 15 cm higher or lower."""
    if case.end_effector is None:
        return None
    place_m = case.end_effector.position_m + level(random, 0.0, 0.3)
    place_m[2] += random.uniform(-0.15, 0.15)
    return replace(case, end_effector=case.end_effector._replace(position_m=tuple(place_m.tolist())))


def turned_within_symmetry(case: Case, random: np.random.Generator) -> Case:
    """Objects that look alike after a turn are seen after it."""
    symmetry = case.settings["yaw_symmetry_deg"]

    def change(pose: ObjectPose) -> ObjectPose:
        period_deg = symmetry.get(pose.name, 360.0)
        angle_deg = random.uniform(-180, 180) if period_deg == 0 else period_deg * int(random.integers(1, 4))
        if pose.quaternion_xyzw is None:
            return pose
        own = Rotation.from_quat(pose.quaternion_xyzw) * Rotation.from_euler("z", angle_deg, degrees=True)
        return replace(pose, quaternion_xyzw=own.as_quat())

    return replace(case, objects=tuple(map(change, case.objects)))


def _declared(case: Case, symmetry_deg: float) -> Case | None:
    given = case.settings["yaw_symmetry_deg"]
    rigid = [pose.name for pose in case.objects if given.get(pose.name, 360.0) > symmetry_deg]
    if not rigid:
        return None
    return replace(case, settings={**case.settings, "yaw_symmetry_deg": {**given, rigid[0]: symmetry_deg}})


def _said(recording: Recording, instruction: str) -> Recording:
    return replace(recording, instruction=instruction)


def _tagged(poses: Poses, main: int, beside_m: Array) -> Poses:
    """With a tag that turns with the main object."""
    pose = poses[main]
    turn = Rotation.identity() if pose.quaternion_xyzw is None else Rotation.from_quat(pose.quaternion_xyzw)
    return (*poses, ObjectPose(TAG, pose.position_m + turn.as_matrix() @ beside_m, pose.quaternion_xyzw))
