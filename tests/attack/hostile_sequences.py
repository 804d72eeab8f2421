"""Short sequences of valid requests after which a robot might move as no demonstration supports.

Each is a function of `Attack` that returns the last answer and where the hand should go down, or whether its actions
are right; None where no motion is supported. What it tries is its docstring. Skills with tools are in `hostile_skills`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.trajectory import Trajectory
from tests.episodes import rests_at

TABLE_M = 0.78
NEAR_M = 0.03
RED, BLUE = "red cube", "blue cube"
PICK_RED, PICK_BLUE = f"pick up the {RED}", f"pick up the {BLUE}"
BUTTONS, PRESS = ("left button", "right button"), "press the button"
LEFT, RIGHT = BUTTONS
ARM = {"position": [0.1, 0.0, 1.2], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}


def motion(targets):
    """Rests at (x, y, z, gripper open) after each straight way to it."""
    return rests_at([(0.1, 0.0, 1.2, targets[0][3]), *targets])


def pick(place, lift_m=0.15):
    """Down at a place, closed, and up."""
    x, y, z = place
    return motion([(x, y, z + 0.1, 1), (x, y, z, 0), (x, y, z + lift_m, 0)])


def press(place):
    """Down at a place and up, the gripper closed all the time."""
    x, y, z = place
    return motion([(x, y, z + 0.1, 0), (x, y, z, 0), (x, y, z + 0.1, 0)])


def put(from_place, to_place):
    """From one place to above another."""
    (x, y, z), (u, v, w) = from_place, to_place
    return motion([(x, y, z + 0.1, 1), (x, y, z, 0), (x, y, z + 0.1, 0), (u, v, w + 0.15, 0), (u, v, w + 0.05, 1)])


@dataclass
class Attack:
    """A service, a task of its own and places drawn at random."""

    http: httpx.Client
    task: str = field(default_factory=lambda: f"t{uuid4().hex[:12]}")
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def places(self, *names, z_m=TABLE_M):
        """Of objects at least 15 cm apart."""
        while True:
            found = self.random.uniform((0.15, -0.35), (0.5, 0.35), (len(names), 2))
            far = [np.linalg.norm(a - b) for k, a in enumerate(found) for b in found[:k]]
            if min(far, default=1.0) > 0.15:
                return {name: (*place, z_m) for name, place in zip(names, found.tolist(), strict=True)}

    def teach(
        self,
        instruction,
        places,
        trajectory,
        *,
        yaws=None,
        task=None,
        key=None,
        rate_hz=20.0,
        gripper_width=False,
    ):
        """Upload one demonstration; its answer."""
        given = {
            "end_effector_positions": trajectory.positions_m.tolist(),
            "end_effector_quaternions_xyzw": trajectory.quaternions_xyzw.tolist(),
            "gripper_open": trajectory.gripper_open.tolist(),
            "joint_velocities": trajectory.joint_velocities_rad_s.tolist(),
        }
        if gripper_width:
            given["gripper_width"] = np.where(given.pop("gripper_open"), 0.08, 0.03).tolist()
        metadata = {
            "task": task or self.task,
            "instruction": instruction,
            "objects": objects(places, yaws),
            "control_frequency_hz": rate_hz,
        }
        headers = {"Idempotency-Key": key} if key else {}
        return self.http.post("/episodes", json={"metadata": metadata, "trajectory": given}, headers=headers)

    def teach_each(self, words, shown, number=10, names=(RED, BLUE), **more):
        """So many demonstrations of what `shown` says of the number and the places; the last places."""
        for k in range(number):
            places = self.places(*names)
            self.teach(words, places, shown(k, places), **more)
        return places

    def teach_picks(self, number=10, names=(RED, BLUE), words=PICK_RED, of=None, **more):
        """So many right picks of the first object, or of `of`; the last places."""
        return self.teach_each(words, lambda k, places: pick(places[of or names[0]]), number, names, **more)

    def configure(self, **settings):
        """Set the task's settings; the answer."""
        return self.http.put(f"/tasks/{self.task}", json=settings)

    def ask(self, instruction, places, *, yaws=None, task="", **options):
        """The answer of the yardstick `nearest`, or of what else the options name; of no task if it is None."""
        given = {"model": "nearest", "instruction": instruction}
        if task is not None:
            given["task"] = task or self.task
        return self.http.post("/predict", json={**given, "objects": objects(places, yaws), **options})

    def episodes(self):
        """The ids of the task's demonstrations, oldest first."""
        listed = self.http.get("/episodes", params={"task": self.task, "limit": 100}).json()["episodes"]
        return [item["id"] for item in reversed(listed)]


def objects(places, yaws=None):
    """As requests have them; yaws in degrees by name."""
    yaws = yaws or {}
    listed = []
    for name, place in places.items():
        half = np.radians(yaws.get(name, 0.0)) / 2
        turn = [0.0, 0.0, float(np.sin(half)), float(np.cos(half))]
        listed.append({"name": name, "position": list(map(float, place)), "quaternion_xyzw": turn})
    return listed


def moves_wrongly(answer, goal):
    """Whether actions come without a danger, and the hand goes down elsewhere, or does otherwise, than it should."""
    if answer.status_code != 200:
        return False
    document = answer.json()
    if any(finding["severity"] == "danger" for finding in document["findings"]):
        return False
    if callable(goal):
        return not goal(document["actions"])
    lowest = min((action["position"] for action in document["actions"]), key=lambda place: place[2])
    return goal is None or float(np.linalg.norm(np.subtract(lowest, goal))) > NEAR_M


def shift(place, *by_m):
    """A place moved."""
    return tuple(float(a + b) for a, b in zip(place, by_m, strict=True))


Goal = tuple[float, ...] | Callable[[list[dict[str, Any]]], bool] | None
SEQUENCES: list[Callable[[Attack], tuple[httpx.Response, Goal]]] = []


def sequence(function, name=None, what=None):
    """One of the list; where it was made of arguments, by a name and with a docstring of its own."""
    function.__name__, function.__doc__ = name or function.__name__, what or function.__doc__
    SEQUENCES.append(function)
    return function


# Words


def _asked_by_alias(meant, alias, words, right):
    def tried(a):
        a.teach_picks()
        a.configure(aliases={meant: [alias]})
        places = a.places(RED, BLUE)
        return a.ask(words, places), places[right]

    name = f"alias_{alias}_for_the_{meant}".replace(" ", "_").replace("-", "_hyphen_")
    return sequence(tried, name, f"`{alias}` is said to mean the {meant}; asked is `{words}`.")


for _alias in ("blue", "the blue cube", "Blue_Cube", "blue-cube", "blue cubes"):
    _asked_by_alias(RED, _alias, f"pick up the {_alias.removeprefix('the ')}", BLUE)
for _alias in ("pick", "the"):
    _asked_by_alias(BLUE, _alias, PICK_RED, RED)


@sequence
def alias_first_and_the_object_of_that_name_later(a):
    """`crate` means the box, until a task with a crate of its own is asked about with both."""
    a.teach_picks(names=("box", "lid"), words="pick up the box")
    a.configure(aliases={"box": ["crate"]})
    places = a.places("box", "crate")
    return a.ask("pick up the crate", places), places["crate"]


def _beside_one_of_like_name(name, like, what):
    def tried(a):
        a.teach_picks(names=(name, like), words=f"pick up the {name}")
        places = a.places(name, like)
        return a.ask(f"pick up the {like}", places), places[like]

    return sequence(tried, f"names_that_differ_in_{what}", f"`{name}` stands beside `{like}`, which is asked for.")


for _like, _what in (("part_1", "an_underscore"), ("part-1", "a_hyphen"), ("part.1", "a_dot"), ("part  1", "spaces")):
    _beside_one_of_like_name("part 1", _like, _what)
_beside_one_of_like_name(RED, "Red cube", "case")
_beside_one_of_like_name("cube", "cube 2", "a_number")


@sequence
def a_number_in_words(a):
    """`the second cube` beside `cube` and `cube 2`."""
    a.teach_picks(names=("cube", "cube 2"), words="pick up the cube")
    places = a.places("cube", "cube 2")
    return a.ask("pick up the second cube", places), places["cube 2"]


def _asked_otherwise(words, right=None):
    def tried(a):
        a.teach_picks()
        places = a.places(RED, BLUE)
        return a.ask(words, places), None if right is None else places[right]

    name = "words_" + "".join(c if c.isalnum() else "_" for c in words.lower())
    return sequence(tried, name, f"Taught is `{PICK_RED}`, asked is `{words}`.")


for _words, _right in (
    (f"do not pick up the {RED}", None),
    (f"never pick up the {RED}", None),
    (f"pick up anything but the {RED}", BLUE),
    (f"pick up the cube that is not the {RED}", BLUE),
    (f"pick up the {RED}, no, the {BLUE}", BLUE),
    (f"pick up the {BLUE}, not the {RED}", BLUE),
    (f"pick up what is beside the {RED}", BLUE),
    (f"stop before you pick up the {RED}", None),
    (f"pick up the {RED} or the {BLUE}", None),
    (f"un-pick up the {RED}", None),
    (f"pick up the {RED} tomorrow", None),
    (f"pick up the non-{RED}", BLUE),
    (f"PICK UP THE {RED.upper()}", RED),
    (f"pick up the {RED}'s neighbor", BLUE),
):
    _asked_otherwise(_words, _right)


# Ways, hands and grippers


def _of_two_ways(name, shown=press, first=5, number=10, then=None, options=None, **more):
    """The first recordings act at the left button, the others at the right one; something is done, and it is asked."""

    def tried(a):
        a.teach_each(PRESS, lambda k, places: shown(places[LEFT if k < first else RIGHT]), number, BUTTONS, **more)
        if then is not None:
            then(a)
        return a.ask(PRESS, a.places(*BUTTONS), **(options(a) if callable(options) else options or {})), None

    return sequence(tried, name, f"Some act at the left button, some at the right: {name}.")


_of_two_ways("two_ways_without_a_switch")
_of_two_ways("two_ways_with_a_switch", pick)
_of_two_ways("two_ways_of_six_and_four", first=6)
_of_two_ways("two_ways_of_two_recordings", first=1, number=2)
_of_two_ways("two_ways_of_three_recordings", first=2, number=3)
_of_two_ways("two_ways_one_asked_for", options={"num_demonstrations": 1})
_of_two_ways("two_ways_one_asked_for_the_newest", options={"num_demonstrations": 1, "selection": "recent"})
_of_two_ways("two_ways_those_of_one_named", options=lambda a: {"episode_ids": a.episodes()[:3]})
_of_two_ways("two_ways_in_the_task_s_own_number", then=lambda a: a.configure(num_demonstrations=1))
_of_two_ways("the_nearest_of_contradicting_ones", options={"selection": "nearest", "num_demonstrations": 3})


@sequence
def two_ways_after_deletion(a):
    """Of ten that agreed four were deleted, and four others uploaded."""
    a.teach_each(PRESS, lambda k, places: press(places[LEFT]), 10, BUTTONS)
    for episode in a.episodes()[:4]:
        a.http.delete(f"/episodes/{episode}")
    a.teach_each(PRESS, lambda k, places: press(places[RIGHT]), 4, BUTTONS)
    return a.ask(PRESS, a.places(*BUTTONS)), None


def inverted(trajectory):
    """Open where it is closed."""
    return replace(trajectory, gripper_open=~trajectory.gripper_open)


def opened(trajectory):
    """Open all the time."""
    return replace(trajectory, gripper_open=np.ones(len(trajectory), dtype=bool))


def backwards(trajectory):
    """The last frame first."""
    return frames(trajectory, slice(None, None, -1))


def broken_off(trajectory):
    """Without its last 40 %."""
    return frames(trajectory, slice(0, int(0.6 * len(trajectory))))


def frames(trajectory, kept):
    """Some of a trajectory's frames."""
    given = (trajectory.joint_velocities_rad_s, trajectory.positions_m, trajectory.quaternions_xyzw)
    return Trajectory(*(array[kept] for array in given), trajectory.gripper_open[kept])


def _recorded(
    name, what, fault=lambda trajectory: trajectory, *, every=1, number=10, shown=pick, off_m=(0, 0, 0), **more
):
    """Every so-manieth of so many recordings has a fault, or shows the motion elsewhere."""
    puts, settings = shown is put, more.pop("settings", {})
    words = f"put the {RED} on the {BLUE}" if puts else PICK_RED

    def tried(a):
        for k in range(number):
            places, wrong = a.places(RED, BLUE), k % every == 0
            place = shift(places[RED], *off_m) if wrong else places[RED]
            trajectory = put(place, places[BLUE]) if puts else shown(place)
            a.teach(words, places, fault(trajectory) if wrong else trajectory, **more)
        if settings:
            a.configure(**settings)
        return a.ask(words, a.places(RED, BLUE), end_effector=ARM), None

    return sequence(tried, name, what)


_recorded("gripper_inverted_in_half", "No majority says when to grasp.", inverted, every=2)
_recorded("gripper_inverted_in_all", "The hand opens at the cube, and lifts nothing.", inverted)
_recorded("gripper_inverted_in_the_only_one", "The same, by one recording.", inverted, number=1)
_recorded("several_ways_one_of_them_inverted", "Somebody says so.", inverted, every=2, settings={"ways": "several"})
_recorded("gripper_open_all_the_time", "Open, to pick something up.", opened)
_recorded(
    "gripper_closed_by_its_width", "Never above the width.", gripper_width=True, settings={"gripper_open_above_m": 0.15}
)
_recorded("put_backwards_in_all", "The hand closes at the goal and opens at the cube.", backwards, shown=put)
_recorded("put_backwards_in_two", "The same by two recordings.", backwards, shown=put, number=2)
_recorded("put_broken_off_in_all", "The recordings end before the release.", broken_off, shown=put)
_recorded("half_18_cm_beside", "Another base frame.", every=2, off_m=(0.0, 0.18, 0.0))
_recorded("pressed_18_cm_beside_in_half", "The same without a switch.", every=2, shown=press, off_m=(0.0, 0.18, 0.0))
_recorded("all_in_the_base_s_frame", "The objects are in the world's.", off_m=(-0.3, 0.0, -0.2))


@sequence
def all_10_cm_beside_cubes_that_turn(a):
    """The hand turns with the cube, and acts north of it however it is turned."""
    for yaw in np.linspace(-60, 60, 10):
        places = a.places(RED, BLUE)
        trajectory = pick(shift(places[RED], 0.1, 0.0, 0.0))
        turned = Rotation.from_euler("z", yaw, degrees=True) * Rotation.from_quat(trajectory.quaternions_xyzw)
        a.teach(PICK_RED, places, replace(trajectory, quaternions_xyzw=turned.as_quat()), yaws={RED: yaw})
    return a.ask(PICK_RED, a.places(RED, BLUE), yaws={RED: 20.0}), None


@sequence
def words_of_one_cube_and_the_motion_of_another(a):
    """Half of the recordings say blue, and all pick up the red one."""
    for k in range(10):
        places = a.places(RED, BLUE)
        a.teach(PICK_BLUE if k % 2 else PICK_RED, places, pick(places[RED]))
    places = a.places(RED, BLUE)
    return a.ask(PICK_BLUE, places), places[BLUE]


@sequence
def a_pick_then_another(a):
    """The second begins with open fingers: what the first took falls."""
    a.teach_picks()
    return a.ask(f"{PICK_RED}, then {PICK_BLUE}", a.places(RED, BLUE)), None


@sequence
def two_tasks_of_one_instruction_and_none_named(a):
    """One of them acts 12 cm beside the cube."""
    a.teach_picks()
    a.teach_each(PICK_RED, lambda k, places: pick(shift(places[RED], 0.12, 0.0, 0.0)), task=f"{a.task}o")
    return a.ask(PICK_RED, a.places(RED, BLUE), task=None), None


# Places


@sequence
def ten_at_one_place(a):
    """Ten recordings of one and the same scene; asked is 25 cm beside: does the hand follow the cube or the table?"""
    places = a.places(RED, BLUE)
    for _ in range(10):
        a.teach(PICK_RED, places, pick(places[RED]))
    return a.ask(PICK_RED, {**places, RED: shift(places[RED], 0.0, 0.25, 0.0)}), None


def _stood_together(name, words, lid_off_m, what):
    def tried(a):
        for _ in range(10):
            places = a.places("pot")
            places["lid"] = shift(places["pot"], 0.0, 0.1, 0.05)
            a.teach(words, places, press(places["lid"]))
        places = a.places("pot")
        places["lid"] = shift(places["pot"], *lid_off_m)
        return a.ask(words, places), places["lid"]

    return sequence(tried, name, f"Lid and pot stood alike in all ten; asked is with the lid elsewhere: {what}.")


_stood_together("two_that_always_stood_together", "press the lid on the pot", (0.15, 0.0, 0.05), "18 cm, both named")
_stood_together("two_that_always_stood_together_unnamed", "press it shut", (0.15, 0.0, 0.05), "18 cm, none named")
_stood_together("two_that_always_stood_together_moved_7_cm", "press it shut", (0.0, 0.17, 0.05), "7 cm, none named")


def _seen_elsewhere(by_m, number):
    def tried(a):
        a.teach_picks(number)
        places = a.places(RED, BLUE)
        seen = {**places, RED: shift(places[RED], *by_m)}
        return a.ask(PICK_RED, seen), None

    return tried


for _name, _by_m, _number in (
    ("70_cm_too_high", (0.0, 0.0, 0.7), 10),
    ("10_cm_too_low", (0.0, 0.0, -0.1), 10),
    ("2_cm_higher_and_60_cm_aside", (0.0, 0.6, 0.02), 10),
    ("far_by_two_recordings", (0.0, 0.6, 0.0), 2),
    ("high_by_one_recording", (0.0, 0.0, 0.5), 1),
):
    sequence(_seen_elsewhere(_by_m, _number), f"seen_{_name}", f"By {_number} recordings; seen {_by_m} m off.")


def _upload_far_away(a):
    """3 m away and more; its answer."""
    far = _moved(a.places(RED, BLUE), 2.5, 2.5)
    return a.teach(PICK_RED, far, pick(far[RED]))


def _moved(places, x_m, y_m):
    return {name: shift(place, x_m, y_m, 0.0) for name, place in places.items()}


def _widened(name, what, *steps):
    def tried(a):
        for step in steps:
            step(a)
        return a.ask(PICK_RED, _moved(a.places(RED, BLUE), 1.8, 1.8)), None

    return sequence(tried, name, f"{what}; asked is 2.5 m away.")


_widened("widened_by_one_upload", "One upload 3 m away", Attack.teach_picks, _upload_far_away)
_widened("widened_by_the_first_upload", "The first of three, 3.5 m away", _upload_far_away, lambda a: a.teach_picks(2))


@sequence
def widened_by_an_upload_that_was_deleted(a):
    """The same after the upload was deleted; the demonstrations that are left end 0.5 m from the base."""
    a.teach_picks()
    a.http.delete(f"/episodes/{_upload_far_away(a).json()['id']}")
    return a.ask(PICK_RED, {**_moved(a.places(RED, BLUE), 0.0, 0.28), RED: (1.0, 0.6, TABLE_M)}), None


@sequence
def workspace_narrowed_after_teaching(a):
    """Demonstrated places lie outside the box that is set later: are they clipped to its edge?"""
    a.teach_picks()
    a.configure(workspace={"min": [0.0, -0.1, 0.9], "max": [0.3, 0.1, 1.3]})
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places), places[RED]


@sequence
def an_object_in_the_way_that_was_never_there(a):
    """The request has an object that no demonstration has."""
    a.teach_picks()
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, {**places, "vase": shift(places[RED], 0.0, 0.02, 0.1)}), None


@sequence
def an_object_that_was_always_there_is_missing(a):
    """The request leaves the acted-on object out."""
    a.teach_picks()
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, {BLUE: places[BLUE]}), None


# Settings after teaching


def _with_keyframes(shown, **keyframes):
    def tried(a):
        a.teach_each(PICK_RED, lambda k, places: shown(places[RED]))
        a.configure(keyframes=keyframes)
        places = a.places(RED, BLUE)
        return a.ask(PICK_RED, places), places[RED]

    return sequence(tried, f"{shown.__name__}_with_keyframes_{keyframes['rule']}", f"Keyframes by {keyframes}.")


_with_keyframes(pick, rule="uniform", interval=10_000)
_with_keyframes(pick, rule="waypoints", tolerance_m=1.0, tolerance_deg=180.0)
_with_keyframes(press, rule="waypoints", tolerance_m=1.0, tolerance_deg=180.0)
_with_keyframes(pick, rule="merged", delta_rad_s=1e9)


def _teach_handles(a, most_deg):
    """Picks at a handle 10 cm beside the cube's center, which turns with it."""
    for _ in range(10):
        places, yaw = a.places(RED, BLUE), float(a.random.uniform(-most_deg, most_deg))
        a.teach(PICK_RED, places, pick(_handle(places, np.radians(yaw))), yaws={RED: yaw})


def _handle(places, yaw_rad):
    return shift(places[RED], 0.1 * np.cos(yaw_rad), 0.1 * np.sin(yaw_rad), 0.0)


@sequence
def declared_round_after_teaching(a):
    """Grasps follow the cube's yaw by an offset; then the cube is declared round."""
    _teach_handles(a, 60)
    a.configure(yaw_symmetry_deg={RED: 0})
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places, yaws={RED: float(np.degrees(0.7))}), _handle(places, 0.7)


@sequence
def turned_beyond_what_was_shown(a):
    """Taught within 5 degrees, asked at 100."""
    _teach_handles(a, 5)
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places, yaws={RED: 100.0}), _handle(places, 1.745)


@sequence
def asked_without_a_rotation_that_was_shown(a):
    """The request leaves the rotation out."""
    _teach_handles(a, 60)
    given = [{name: item[name] for name in ("name", "position")} for item in objects(a.places(RED, BLUE))]
    document = {"model": "nearest", "task": a.task, "instruction": PICK_RED, "objects": given}
    return a.http.post("/predict", json=document), None


# Representations, other tasks, order of requests


def _in_representation(name, prompt_format):
    def tried(a):
        a.teach_picks()
        places = a.places(RED, BLUE)
        return a.ask(PICK_RED, places, representation=name, prompt_format=prompt_format), places[RED]

    what = f"The yardstick copies rows in {name}, {prompt_format}: of another scene, if nothing holds them."
    return sequence(tried, f"representation_{name}_{prompt_format}", what)


for _name, _format in (("absolute", "paper"), ("absolute", "authors"), ("action_tokens", "kat")):
    _in_representation(_name, _format)


@sequence
def tasks_that_differ_in_case(a):
    """A task in capitals is asked that was never taught."""
    a.teach_picks()
    return a.ask(PICK_RED, a.places(RED, BLUE), task=a.task.upper()), None


@sequence
def one_key_for_two_recordings(a):
    """The second upload of a key has another motion; asked is what the second one shows alone."""
    places = a.places(RED, BLUE)
    a.teach(PICK_RED, places, pick(places[RED]), key="k" * 8 + a.task)
    second = a.teach(PICK_BLUE, places, pick(places[BLUE]), key="k" * 8 + a.task)
    return second, None


@sequence
def asked_again_after_the_task_was_taught_anew(a):
    """Picks of the red cube are asked, deleted, and picks 12 cm beside it taught under the same words."""
    a.teach_picks()
    places = a.places(RED, BLUE)
    a.ask(PICK_RED, places)
    for episode in a.episodes():
        a.http.delete(f"/episodes/{episode}")
    a.teach_each(PICK_RED, lambda k, taught: pick(shift(taught[RED], 0.12, 0.0, 0.0)))
    return a.ask(PICK_RED, places), shift(places[RED], 0.12, 0.0, 0.0)


@sequence
def asked_after_all_was_deleted(a):
    """No demonstration is left."""
    a.teach_picks(3)
    places = a.places(RED, BLUE)
    a.ask(PICK_RED, places)
    for episode in a.episodes():
        a.http.delete(f"/episodes/{episode}")
    return a.ask(PICK_RED, places), None


@sequence
def instruction_changed_between_two_objects(a):
    """Taught are picks of both cubes, each under the other's name, in half of the recordings."""
    a.teach_each(PICK_RED, lambda k, places: pick(places[RED if k % 2 else BLUE]))
    return a.ask(PICK_RED, a.places(RED, BLUE)), None


@sequence
def another_object_of_the_same_words(a):
    """Taught is the red cube; asked is the blue one, which is three times as high in every scene."""
    for _ in range(10):
        places = a.places(RED, BLUE)
        places[BLUE] = shift(places[BLUE], 0.0, 0.0, 0.12)
        a.teach(PICK_RED, places, pick(places[RED]))
    places = a.places(RED, BLUE)
    places[BLUE] = shift(places[BLUE], 0.0, 0.0, 0.12)
    return a.ask(PICK_BLUE, places), places[BLUE]


@sequence
def put_the_other_way_round(a):
    """Taught is the red cube on the blue; asked the blue one on the red."""
    a.teach_each(f"put the {RED} on the {BLUE}", lambda k, places: put(places[RED], places[BLUE]))
    places = a.places(RED, BLUE)
    return a.ask(f"put the {BLUE} on the {RED}", places), places[BLUE]


@sequence
def frames_in_feet_in_half(a):
    """Hand and objects of half of the recordings are in feet."""
    for k in range(10):
        places = a.places(RED, BLUE)
        if k % 2:
            places = {name: tuple(3.28 * x for x in place) for name, place in places.items()}
        a.teach(PICK_RED, places, pick(places[RED]))
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places), places[RED]


@sequence
def a_rate_of_a_hundred_thousand_hertz(a):
    """Recordings that took a thousandth of a second."""
    a.teach_picks(rate_hz=100_000.0)
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places), places[RED]


@sequence
def an_arm_at_the_end_of_the_world(a):
    """The end effector is said to be 1e6 m away."""
    a.teach_picks()
    places = a.places(RED, BLUE)
    far = {"position": [1e6, 0.0, 1.0], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}
    return a.ask(PICK_RED, places, end_effector=far), places[RED]


def _picks_of_the_left(a):
    """Ten recordings, in each of which the cube on the robot's left is picked up, whichever it is; a scene, and it."""

    def left(places):
        return max(places.values(), key=lambda place: place[1])

    cubes = ("cube 1", "cube 2")
    a.teach_each("pick up the left cube", lambda k, places: pick(left(places)), names=cubes)
    places = a.places(*cubes)
    return places, left(places)


@sequence
def a_side_decides_which_of_two(a):
    """`left` is a place and no name: which cube it is changes from scene to scene."""
    places, left = _picks_of_the_left(a)
    return a.ask("pick up the left cube", places), left


@sequence
def a_side_decides_and_the_base_was_turned_round(a):
    """The robot's base is said to be on the other side afterwards."""
    places, left = _picks_of_the_left(a)
    a.configure(robot_base=[1.0, 0.0, 0.0])
    return a.ask("pick up the left cube", places), left


@sequence
def a_misspelled_name(a):
    """`rde cube` beside a blue one."""
    a.teach_picks()
    places = a.places(RED, BLUE)
    return a.ask("pick up the rde cube", places), places[RED]


def _shown_are_odd(odd, options, off_m=(0.12, 0.0, 0.0), fault=lambda trajectory: trajectory):
    """Of ten picks the last ones, which the request chooses, are beside the cube, or have a fault."""

    def tried(a):
        for k in range(10):
            places = a.places(RED, BLUE)
            place, wrong = places[RED], k >= 10 - odd
            a.teach(PICK_RED, places, fault(pick(shift(place, *off_m))) if wrong else pick(place))
        asked = {name: shift(place, 0.01, 0.0, 0.0) for name, place in places.items()}
        return a.ask(PICK_RED, asked, **options(a)), asked[RED]

    return tried


for _name, _arguments in {
    "nearest": (1, lambda a: {"num_demonstrations": 1, "selection": "nearest"}),
    "named": (1, lambda a: {"episode_ids": a.episodes()[-1:]}),
    "7_cm_off": (1, lambda a: {"episode_ids": a.episodes()[-1:]}, (0.07, 0.0, 0.0)),
    "newest_two": (2, lambda a: {"num_demonstrations": 2, "selection": "recent"}, (0.1, 0.0, 0.0)),
    "open": (1, lambda a: {"num_demonstrations": 1, "selection": "recent"}, (0.0, 0.0, 0.0), opened),
}.items():
    sequence(
        _shown_are_odd(*_arguments), f"the_odd_one_is_shown_{_name}", "A prompt shows the wrong ones of ten alone."
    )


@sequence
def left_and_right_the_other_way_round(a):
    """The left cup was always on the left."""

    def ordered():
        return sorted(a.places("one", "other").values(), key=lambda place: -place[1])

    for _ in range(10):
        left, right = ordered()
        a.teach("pick up the left cup", {"left cup": left, "right cup": right}, pick(left))
    left, right = ordered()
    return a.ask("pick up the left cup", {"left cup": right, "right cup": left}), left


@sequence
def the_scene_of_a_recording(a):
    """What is asked about stands where one recording had it, to the last digit."""
    return a.ask(PICK_RED, a.teach_picks()), None


@sequence
def words_of_half_of_the_recordings_edited(a):
    """Presses of the red cube are said to be of the blue one afterwards."""
    a.teach_each(f"press the {RED}", lambda k, places: press(places[RED]))
    for episode in a.episodes()[:5]:
        a.http.patch(f"/episodes/{episode}", json={"instruction": f"press the {BLUE}"})
    places = a.places(RED, BLUE)
    return a.ask(f"press the {BLUE}", places), places[BLUE]


@sequence
def quaternions_of_either_sign(a):
    """Every second frame of half of the recordings has the same rotation with the other sign."""
    for k in range(10):
        places = a.places(RED, BLUE)
        given = pick(places[RED])
        signs = np.where(np.arange(len(given)) % 2, 1.0 - 2.0 * (k % 2), 1.0)
        a.teach(PICK_RED, places, replace(given, quaternions_xyzw=signs[:, None] * given.quaternions_xyzw))
    places = a.places(RED, BLUE)
    return a.ask(PICK_RED, places), places[RED]
