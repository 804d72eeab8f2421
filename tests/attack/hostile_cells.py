"""Sequences by an outsider: mistakes of cameras, tools, clocks and operators, judged by what a table's things become.

Each skill is asked without a mistake, too: `CONTROLS` must be right, and not stopped.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.trajectory import Trajectory
from tests.attack.cell import UP, Cell, Thing
from tests.attack.hostile_sequences import SEQUENCES, frames, moves_wrongly, sequence
from tests.attack.hostile_skills import DOWN, RATE_HZ, flowing

TABLE_M = 0.78
START = {"position": [0.1, 0.0, 1.2], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}
INCHES = 1 / 0.0254
QUESTIONS = 3


@dataclass(frozen=True)
class Scene:
    """Where things are: (3,) m and degrees about the vertical by name."""

    places: dict
    yaws: dict

    def moved(self, *names, by_m=(0.0, 0.0, 0.0), turn_deg=0.0, change=None):
        """With these things, or all, elsewhere; `change` is of their places."""
        names = names or tuple(self.places)
        change = change or (lambda place: place + np.array(by_m))
        places = {n: change(p) if n in names else p for n, p in self.places.items()}
        return Scene(places, {n: y + turn_deg if n in names else y for n, y in self.yaws.items()})

    def hand(self, name):
        """Of fingers that point down and close across a thing."""
        return Rotation.from_euler("z", self.yaws[name], degrees=True) * DOWN

    def seen_from(self, name, offset_m):
        """A place in the axes of a thing."""
        return self.places[name] + Rotation.from_euler("z", self.yaws[name], degrees=True).apply(offset_m)


@dataclass(frozen=True)
class Demo:
    """One upload."""

    words: str
    scene: Scene
    trajectory: Trajectory | None
    quaternions: dict = field(default_factory=dict)  # of objects, where a yaw does not say it
    widths: np.ndarray | None = None


@dataclass(frozen=True)
class Skill:
    """What is taught.

    Attributes:
        stops: of a scene, (place, rotation, gripper open) each.
        done: whether a cell after the actions, which began as the scene, is as meant.
        long: things that fingers must close across.
        most_deg: how far things are turned.
    """

    words: str
    names: tuple[str, ...]
    stops: Callable
    done: Callable
    most_deg: float = 40.0
    long: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()  # things that never move

    def draw(self, a):
        """A scene."""
        while True:
            places = {name: np.array(place) for name, place in a.places(*self.names, z_m=TABLE_M).items()}
            for number, name in enumerate(self.fixed):
                places[name] = np.array([0.55, -0.3 + 0.6 * number, TABLE_M])
            listed = [*places.values()]
            if min((np.linalg.norm(p - q) for k, p in enumerate(listed) for q in listed[:k]), default=1.0) > 0.15:
                break
        yaws = {name: float(a.random.uniform(-self.most_deg, self.most_deg)) for name in self.names}
        return Scene(places, {**yaws, **dict.fromkeys(self.fixed, 0.0)})

    def demo(self, scene):
        """As it is recorded."""
        return Demo(self.words, scene, recorded(self.stops(scene)))

    def cell(self, scene):
        """What the actions are done to."""
        return Cell({n: Thing(p.copy(), scene.yaws[n], n in self.long) for n, p in scene.places.items()})

    def right(self, scene, tool_m=(0.0, 0.0, 0.0)):
        """Of actions, whose point of the hand is `tool_m` from the fingertips in the hand's axes."""

        def fingertips(action):
            hand = Rotation.from_quat(action["quaternion_xyzw"])
            return {**action, "position": np.array(action["position"]) - hand.apply(tool_m)}

        return lambda actions: bool(self.done(self.cell(scene).carry_out([*map(fingertips, actions)]), scene))


# Skills


def recorded(stops):
    """From where the arm always starts."""
    return flowing([(START["position"], DOWN, stops[0][2]), *stops])


def over(place, height_m=0.1):
    return place + height_m * UP


def take(name, lift_m=0.2):
    def stops(scene):
        place, hand = scene.places[name], scene.hand(name)
        return [(over(place), hand, 1), (place, hand, 0), (over(place, lift_m), hand, 0)]

    return stops


def press(*names):
    places = lambda scene: [scene.places[name] for name in names]  # noqa: E731
    return lambda scene: [(at, DOWN, 0) for p in places(scene) for at in (over(p), p, over(p))]


def put(name, goal, offset=(0.0, 0.0, 0.05), *, aligned=True, turns_with=True):
    """Takes a thing, and lets go of it at the goal (offset along its axes, or the world's), turned as the goal is."""

    def stops(scene):
        hand = scene.hand(goal if aligned else name)
        to = scene.seen_from(goal, offset) if turns_with else scene.places[goal] + offset
        return [*take(name)(scene), (over(to, 0.15), hand, 0), (to, hand, 1), (over(to), hand, 1)]

    return stops


def turn(name, degrees=90):
    def stops(scene):
        place, hand = scene.places[name], scene.hand(name)
        turned = [Rotation.from_euler("z", step, degrees=True) * hand for step in np.linspace(0, degrees, 4)]
        at = [(place, step, 0) for step in turned]
        return [(over(place), hand, 1), *at, (place, turned[-1], 1), (over(place), turned[-1], 1)]

    return stops


def push(name, by_m=0.12):
    def stops(scene):
        behind, ahead = (scene.places[name] + np.array([x, 0.0, 0.0]) for x in (-0.08, by_m - 0.08))
        return [(over(behind), DOWN, 0), (behind, DOWN, 0), (ahead, DOWN, 0), (over(ahead), DOWN, 0)]

    return stops


def push_to(name, goal):
    """To the x of another thing."""

    def stops(scene):
        behind = scene.places[name] - np.array([0.08, 0.0, 0.0])
        ahead = np.array([scene.places[goal][0] - 0.04, *behind[1:]])
        return [(over(behind), DOWN, 0), (behind, DOWN, 0), (ahead, DOWN, 0), (over(ahead), DOWN, 0)]

    return stops


def _puts(name, goal, offset=(0.0, 0.0, 0.05), words="put the {} on the {}", **how):
    """A skill, and how its thing should lie."""
    at = (lambda s: s.seen_from(goal, offset)) if how.get("turns_with", True) else (lambda s: s.places[goal] + offset)
    lies = lambda c, s: c.put(name, at(s))  # noqa: E731
    return Skill(words.format(name, goal), (name, goal), put(name, goal, offset, **how), lies)


CUBE, PLATE, ASIDE = "red cube", "plate", (0.0, 0.13, 0.0)
LEFT_OF = "put the {} beside the {}"
PUT = _puts(CUBE, PLATE)
INSERT = Skill(
    "insert the peg into the socket",
    ("peg", "socket"),
    put("peg", "socket", (0.0, 0.0, 0.02)),
    lambda c, s: c.put("peg", over(s.places["socket"], 0.02), s.yaws["socket"], 0.015),
    long=("peg",),
)
BUTTONS = ("green button", "white button")
SKILLS = {
    "take": Skill(f"pick up the {CUBE}", (CUBE, "bowl"), take(CUBE), lambda c, s: c.took(CUBE)),
    "bar": Skill("pick up the bar", ("bar", "bowl"), take("bar"), lambda c, s: c.took("bar"), long=("bar",)),
    "press": Skill("press the bell", ("bell", "lamp"), press("bell"), lambda c, s: c.pressed("bell")),
    "both": Skill("press both buttons", BUTTONS, press(*BUTTONS), lambda c, s: c.pressed(*BUTTONS)),
    "put": PUT,
    "fixed": replace(PUT, fixed=(PLATE,)),
    "away": replace(_puts(CUBE, "bin", words="put the {} away"), fixed=("bin",)),
    "insert": INSERT,
    "beside": _puts(CUBE, "box", ASIDE, LEFT_OF, aligned=False, turns_with=False),
    "parallel": _puts(CUBE, "box", ASIDE, LEFT_OF, turns_with=False),
    "turn": Skill(
        "turn the knob", ("knob", "lamp"), turn("knob"), lambda c, s: abs(c.turned_deg - 90) < 15, long=("knob",)
    ),
    "push": Skill(
        "push the block forward",
        ("block", "lamp"),
        push("block"),
        lambda c, s: c.visited([s.places["block"] - [0.08, 0, 0], s.places["block"] + [0.04, 0, 0]]),
    ),
}
OUT_OF = replace(_puts(CUBE, PLATE, words="take the {} off"), names=(CUBE, PLATE, "bin"))
TAKE, BAR, PRESS, BOTH, FIXED, AWAY, BESIDE, TURN, PUSH = (
    SKILLS[name] for name in ("take", "bar", "press", "both", "fixed", "away", "beside", "turn", "push")
)


# Mistakes: of a recording and its number


def hand_changed(where):
    """The same trajectory with its positions (T, 3) and hands (T rotations) changed."""

    def fault(demo, *_):
        t = demo.trajectory
        positions, hands = where(t.positions_m.copy(), Rotation.from_quat(t.quaternions_xyzw.copy()))
        return replace(demo, trajectory=replace(t, positions_m=positions, quaternions_xyzw=hands.as_quat()))

    return fault


def tool(*offset_m, turn_deg=0.0, axis="z"):
    """Another point and another frame of the hand is reported."""
    turn = Rotation.from_euler(axis, turn_deg, degrees=True)
    return hand_changed(lambda p, r: (p + r.apply(offset_m or (0.0, 0.0, 0.0)), r * turn))


def frame(*by_m, turn_deg=0.0, axis="z", scale=1.0):
    """The hand is reported in another frame of the world."""
    turn = Rotation.from_euler(axis, turn_deg, degrees=True)
    return hand_changed(lambda p, r: (scale * turn.apply(p) + (by_m or (0.0, 0.0, 0.0)), turn * r))


def mirrored(demo, *_):
    """The hand's y axis points the other way."""
    t = demo.trajectory
    quaternions = t.quaternions_xyzw * [-1.0, 1.0, -1.0, 1.0]
    return replace(demo, trajectory=replace(t, positions_m=t.positions_m * [1, -1, 1], quaternions_xyzw=quaternions))


def seen(change):
    """Objects are seen otherwise than they are."""
    return lambda demo, k: replace(demo, scene=change(demo.scene, k))


def view(*by_m, turn_deg=0.0, scale=1.0, pivot=(0.8, 0.0, 1.5)):
    """The camera at the pivot was bumped: all things are seen elsewhere."""
    turn = Rotation.from_euler("z", turn_deg, degrees=True)

    def change(scene, _):
        elsewhere = lambda place: pivot + scale * turn.apply(place - pivot) + (by_m or (0.0, 0.0, 0.0))  # noqa: E731
        return scene.moved(change=elsewhere, turn_deg=turn_deg)

    return seen(change)


def shifted(*names, **how):
    """Some things are seen elsewhere than they are; see `Scene.moved`."""
    return seen(lambda scene, _: scene.moved(*names, **how))


def exchanged(one, other):
    """Two things have each other's names."""

    def fault(demo, *_):
        places, yaws = dict(demo.scene.places), dict(demo.scene.yaws)
        for of in (places, yaws):
            of[one], of[other] = of[other], of[one]
        return replace(demo, scene=Scene(places, yaws))

    return fault


def yaw_times(factor):
    """The quaternions of objects are computed wrongly from their yaw."""

    def fault(demo, *_):
        half_rad = {n: factor * np.radians(y) / 2 for n, y in demo.scene.yaws.items()}
        return replace(demo, quaternions={n: [0, 0, np.sin(r), np.cos(r)] for n, r in half_rad.items()})

    return fault


def clock(change):
    """The frames are changed: a trajectory of a trajectory."""
    return lambda demo, *_: replace(demo, trajectory=change(demo.trajectory))


def first_switch(t):
    return int(np.flatnonzero(np.diff(t.gripper_open))[0])


def delayed(seconds):
    """The gripper is recorded so much later than the hand."""

    def change(t):
        n = round(RATE_HZ * seconds)
        return replace(t, gripper_open=t.gripper_open[np.clip(np.arange(len(t)) - n, 0, len(t) - 1)])

    return clock(change)


twice = clock(lambda t: frames(t, np.tile(np.arange(len(t)), 2)))
without_the_grasp = clock(lambda t: frames(t, np.r_[0 : max(1, first_switch(t) - 15), first_switch(t) + 15 : len(t)]))
second_half_first = clock(lambda t: frames(t, np.roll(np.arange(len(t)), -(len(t) // 2))))
ended_at_grasp = clock(lambda t: frames(t, slice(0, first_switch(t) + 5)))
from_the_grasp_on = clock(lambda t: frames(t, slice(first_switch(t) + 1, None)))


@clock
def slipped(t):
    """Open for three frames on the way."""
    is_open = t.gripper_open.copy()
    switches = np.flatnonzero(np.diff(is_open))
    middle = int(switches[0] + (switches[1] - switches[0]) * 0.6)
    is_open[middle : middle + 3] = True
    return replace(t, gripper_open=is_open)


def widths(of):
    """The width of the fingers is recorded instead of whether they are open."""
    return lambda demo, k: replace(demo, widths=of(demo.trajectory.gripper_open, k))


def shows(stops):
    """Another motion under the same words."""
    return lambda demo, *_: replace(demo, trajectory=recorded(stops(demo.scene)))


def after(demo, *_):
    """Objects as they are after the motion: what was carried is at the goal."""
    return replace(demo, scene=demo.scene.moved(CUBE, change=lambda _: over(demo.scene.places[PLATE], 0.05)))


def in_inches(demo, *_):
    """Everything."""
    return replace(frame(scale=INCHES)(demo), scene=demo.scene.moved(change=lambda place: INCHES * place))


def stale(which):
    """The plate's pose is that of the recording before, in some."""
    last = {}

    def fault(demo, k):
        before = last.get("at", demo.scene.places[PLATE])
        last["at"] = demo.scene.places[PLATE]
        return replace(demo, scene=demo.scene.moved(PLATE, change=lambda _: before)) if which(k) else demo

    return fault


# Asking


def half(k):
    return k % 2 == 1


def every(k):
    return True


def last_four(k):
    return k >= 6


def third(k):
    return k % 3 == 2


def uploaded(a, demo):
    """An upload."""
    t, scene = demo.trajectory, demo.scene
    given = {
        "end_effector_positions": t.positions_m.tolist(),
        "end_effector_quaternions_xyzw": t.quaternions_xyzw.tolist(),
        "joint_velocities": t.joint_velocities_rad_s.tolist(),
    }
    if demo.widths is None:
        given["gripper_open"] = t.gripper_open.tolist()
    else:
        given["gripper_width"] = demo.widths.tolist()
    metadata = {
        "task": a.task,
        "instruction": demo.words,
        "objects": things(scene, demo.quaternions),
        "control_frequency_hz": RATE_HZ,
    }
    return a.http.post("/episodes", json={"metadata": metadata, "trajectory": given})


def things(scene, quaternions=None):
    quaternions = quaternions or {}
    return [
        {
            "name": name,
            "position": place.tolist(),
            "quaternion_xyzw": list(
                quaternions.get(name, Rotation.from_euler("z", scene.yaws[name], degrees=True).as_quat())
            ),
        }
        for name, place in scene.places.items()
    ]


def case(
    name,
    skill,
    fault=lambda demo, k: demo,
    wrong=half,
    *,
    number=10,
    asked=lambda scene: scene,
    true=lambda scene: scene,
    arm=START,
    settings=None,
    shown=(),
    judge=None,
):
    """A sequence: `fault` in the recordings that are `wrong`, and a scene that is seen `asked` and is `true`.

    Args:
        shown: the numbers of the recordings that the request names; all without any.
        judge: of a scene, instead of the skill's.
    """

    def tried(a):
        a.random = np.random.default_rng(sum(map(ord, name)))
        if settings:
            a.configure(**settings)
        for k in range(number):
            demo = skill.demo(skill.draw(a))
            uploaded(a, fault(demo, k) if wrong(k) else demo)
        asks = {"model": "nearest", "task": a.task, "instruction": skill.words}
        asks |= {"end_effector": arm} if arm else {}
        asks |= {"episode_ids": [a.episodes()[k] for k in shown]} if shown else {}
        for _ in range(QUESTIONS):
            scene = skill.draw(a)
            answer = a.http.post("/predict", json={**asks, "objects": things(asked(scene))})
            judged = (judge or skill.right)(true(scene))
            if moves_wrongly(answer, judged):
                break
        return answer, judged

    return sequence(tried, name, name.replace("_", " "))


def in_half_and_all(name, skill, fault, **more):
    """Two sequences."""
    case(f"{name}_in_half", skill, fault, **more)
    case(f"{name}_in_all", skill, fault, every, **more)


def really(name, skill, *names, seen_too=True, **how):
    """Nothing is wrong with the recordings; in the question things are elsewhere than shown."""
    moved = lambda scene: scene.moved(*names, **how)  # noqa: E731
    case(name, skill, asked=moved, true=moved if seen_too else lambda scene: scene)


CONTROLS = [f"right_{name}" for name in SKILLS]
for _name, _skill in SKILLS.items():
    case(f"right_{_name}", _skill)

# Another point or frame of the hand, or another base
for _skill_name in ("take", "put", "insert", "press"):
    case(f"two_tool_centers_{_skill_name}", SKILLS[_skill_name], tool(0.0, 0.0, -0.1))
case("three_tool_centers", PUT, lambda d, k: tool(0, 0, -0.03 * (k % 3))(d), every)
BRACKET_M = (0.04, 0.0, -0.06)
AT_BRACKET = {"position": [0.14, 0.0, 1.26], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}
case("tool_center_aside_in_half", BAR, tool(*BRACKET_M))
case("tool_center_aside_in_all", BAR, tool(*BRACKET_M), every, arm=AT_BRACKET, judge=lambda s: BAR.right(s, BRACKET_M))
case("tool_center_aside_in_all_but_the_question", BAR, tool(*BRACKET_M), every)
in_half_and_all("flange_turned_45", BAR, tool(turn_deg=45))
case("flange_turned_90_in_half", BAR, tool(turn_deg=90))
case("flange_turned_20_in_half", INSERT, tool(turn_deg=20))
case("tool_points_along_x_in_half", PUT, tool(turn_deg=90, axis="y"))
in_half_and_all("hand_conjugated", BAR, hand_changed(lambda p, r: (p, r.inv())))
in_half_and_all("left_handed_world", PUT, mirrored)
case("base_turned_180_in_half", PUT, frame(0.8, 0, 0, turn_deg=180))
case("base_turned_5_in_half", PUT, frame(turn_deg=5))
case("base_turned_12_in_all", PUT, frame(turn_deg=12), every)
case("base_4_cm_beside_in_last_four", PUT, frame(0.0, 0.04, 0.0), last_four)
case("parallel_and_the_hand_12_cm_beside_in_all", SKILLS["parallel"], frame(0.0, 0.12, 0.0), every)

# Cameras, tables, models of objects, and yaws
case("camera_bumped_6_cm", PUT, view(0.06, 0.0, 0.0), last_four)
case("camera_turned_8_deg", INSERT, view(turn_deg=8), last_four)
case("camera_drifts", PUT, seen(lambda s, k: s.moved(by_m=(0.01 * k, 0, 0))), every)
really("camera_bumped_before_the_question", PUT, by_m=(0.04, 0, 0.03), seen_too=False)
case("depth_10_percent_long_in_half", PUT, view(scale=1.1))
case("table_7_cm_lower_in_half", PUT, view(0.0, 0.0, -0.07))
case("pressed_table_7_cm_lower_in_half", SKILLS["press"], view(0.0, 0.0, -0.07))
case("table_5_cm_higher_in_a_third", PUT, view(0.0, 0.0, 0.05), third)
case("camera_7_cm_aside_in_a_third", SKILLS["take"], view(0.0, 0.07, 0.0), third)
LONG = view(scale=1.1)
case("depth_10_percent_long_in_all", PUT, LONG, every, asked=lambda s: LONG(Demo("", s, None), 0).scene)
case("lower_table_said_the_same", PUT, frame(0, 0, -0.08))
_third_table = lambda s: s.moved(by_m=(0, 0, 0.12))  # noqa: E731
_lower = lambda d, k: shifted(by_m=(0, 0, -0.08))(frame(0, 0, -0.08)(d), k)  # noqa: E731
case("lower_table_said_rightly", PUT, _lower, asked=_third_table, true=_third_table)
case("taller_cube_of_one_name", TAKE, shifted(CUBE, by_m=(0, 0, 0.05)), last_four)
really("taller_cube_in_the_question", TAKE, CUBE, by_m=(0, 0, 0.04), seen_too=False)
_at_rim = seen(lambda s, k: s.moved(PLATE, change=lambda _: s.seen_from(PLATE, (0.08, 0, 0))))
case("origin_at_the_rim_in_half", PUT, _at_rim)
for _degrees, _thing in ((30, "peg"), (90, "peg"), (180, "socket")):
    case(f"model_turned_{_degrees}_in_half", INSERT, shifted(_thing, turn_deg=_degrees))
in_half_and_all("doubled_yaw", BAR, yaw_times(2.0))
case("halved_yaw_in_all", BAR, yaw_times(0.5), every)
case("negative_yaw_in_all", BAR, yaw_times(-1.0), every)
case("yaw_in_radians_read_as_degrees_in_half", BAR, yaw_times(np.pi / 180))
_random_yaw = seen(lambda s, k: s.moved("bar", turn_deg=float(np.random.default_rng(k).uniform(-60, 60))))
case("yaw_of_chance_in_all", BAR, _random_yaw, every)

# The gripper and the clock
_finger = widths(lambda o, k: np.where(o, 0.04 if half(k) else 0.08, 0.005))
case("finger_travel_in_half", PUT, _finger, every, settings={"gripper_open_above_m": 0.06})
_unit = widths(lambda o, k: np.where(o, 0.008 if half(k) else 0.08, 0.0))
case("width_in_another_unit_half_way", PUT, _unit, every, settings={"gripper_open_above_m": 0.04})
_noisy = widths(lambda o, k: np.where(o, 0.08, 0.076) + np.random.default_rng(k).normal(0, 0.002, len(o)))
case("thick_thing_and_noisy_width", TAKE, _noisy, every)
case("gripper_late_in_half", TAKE, delayed(0.7))
case("gripper_late_in_all", TAKE, delayed(0.8), every)
case("gripper_early_in_all", TAKE, delayed(-0.5), every)
case("gripper_late_in_all_of_a_put", PUT, delayed(0.8), every)
in_half_and_all("slipped", PUT, slipped)
case("time_runs_twice_in_half", PUT, twice)
case("time_runs_twice_in_all", PRESS, twice, every)
case("without_the_grasp_in_half", PUT, without_the_grasp)
case("without_the_grasp_in_all", TAKE, without_the_grasp, every)
case("ring_buffer_in_half", PUT, second_half_first)
case("ring_buffer_in_all", PRESS, second_half_first, every)
case("ended_at_the_grasp_in_half", TAKE, ended_at_grasp)
case("ended_at_the_grasp_in_a_third", TAKE, ended_at_grasp, third)
case("in_the_hand_from_the_start", PUT, from_the_grasp_on, every)
case("in_the_hand_from_the_start_in_half", PUT, from_the_grasp_on)

# Poses of another moment, and of what never moved
case("things_as_they_are_afterwards", PUT, after, every)
case("things_as_they_are_afterwards_in_half", PUT, after)
for _which, _said in ((every, "all"), (half, "half"), (third, "a_third")):
    case(f"goal_stale_in_{_said}", PUT, stale(_which), every)
really("goal_never_moved", FIXED, PLATE, by_m=(-0.2, 0.05, 0))
really("bin_never_moved", AWAY, "bin", by_m=(-0.2, 0.05, 0))
really("bin_never_moved_4_cm", AWAY, "bin", by_m=(-0.04, 0, 0))
really("socket_never_turned", replace(INSERT, fixed=("socket",)), "socket", turn_deg=40)
_on_the_plate = lambda s: s.moved(CUBE, change=lambda _: over(s.places[PLATE], 0.05))  # noqa: E731
case("already_there", PUT, asked=_on_the_plate, judge=lambda s: lambda actions: False)

# What a person declares, and does
really("peg_with_a_key_seen_a_quarter_turned", INSERT, "peg", turn_deg=90, seen_too=False)
_key = lambda s: s.moved("peg", turn_deg=80)  # noqa: E731
_square = {"yaw_symmetry_deg": {"peg": 90}}
case("peg_with_a_key_said_to_be_square", INSERT, settings=_square, asked=_key, true=_key)
case("socket_said_to_be_round", INSERT, settings={"yaw_symmetry_deg": {"socket": 0}})
case("long_bar_said_to_be_square", replace(BAR, most_deg=90.0), settings={"yaw_symmetry_deg": {"bar": 90}})
for _degrees in (60, 25):
    _otherwise = shows(lambda s, by=_degrees: INSERT.stops(s.moved("socket", turn_deg=by)))
    case(f"peg_inserted_{_degrees}_degrees_otherwise_in_half", INSERT, _otherwise)
_half_turned = shows(lambda s: [*INSERT.stops(s)[:3], *INSERT.stops(s.moved("socket", turn_deg=180))[3:]])
case("released_half_a_turn_otherwise_in_half", INSERT, _half_turned, settings={"gripper_symmetry_deg": 180})
_other_side, _in_front = (
    shows(put(CUBE, "box", at, aligned=False, turns_with=False)) for at in ((0.0, -0.13, 0.0), (-0.13, 0.0, 0.0))
)
case("operator_across_the_table", BESIDE, _other_side)
case("beside_in_the_other_axis_in_half", BESIDE, _in_front)
case("order_of_two_buttons", BOTH, shows(press(*BUTTONS[::-1])))
case("order_of_two_buttons_in_a_third", BOTH, shows(press(*BUTTONS[::-1])), third)
case("one_of_two_buttons_in_half", BOTH, shows(press("green button")))
case("clockwise_in_half", TURN, shows(turn("knob", -90)))
case("half_as_far_in_half", TURN, shows(turn("knob", 45)))
case("twice_as_far_in_half", TURN, shows(turn("knob", 180)))
case("a_pick_is_pushed_in_half", TAKE, shows(push(CUBE)))
case("pushed_by_less_in_half", PUSH, shows(push("block", 0.06)))
case("pushed_the_other_way_in_half", PUSH, shows(push("block", -0.12)))
UP_TO = Skill(
    "push the block to the ruler",
    ("block", "ruler"),
    push_to("block", "ruler"),
    lambda c, s: c.visited([at for at, _, _ in push_to("block", "ruler")(s)[1:3]]),
)
case("pushed_up_to_another_thing", UP_TO)
for _number in (3, 5):
    case(
        f"plate_and_bin_exchanged_in_one_of_{_number}",
        OUT_OF,
        exchanged(PLATE, "bin"),
        lambda k: k == 1,
        number=_number,
    )

# Units and axes
case("hand_in_inches_in_half", TAKE, frame(scale=INCHES))
case("all_in_inches_in_half", TAKE, in_inches)
case("all_in_inches", TAKE, in_inches, every)
for _unit_name, _scale in (("inches", INCHES), ("feet", 3.28)):
    case(f"question_in_{_unit_name}", TAKE, asked=lambda s, by=_scale: s.moved(change=lambda place: by * place))
case("objects_above_the_table_in_half", PUT, shifted(by_m=(0, 0, -TABLE_M)))
really("objects_above_the_table_in_the_question", PUT, by_m=(0, 0, -TABLE_M), seen_too=False)
case("x_and_y_exchanged_in_half", PUT, shifted(change=lambda place: place[[1, 0, 2]]))
really("x_and_y_exchanged_in_the_question", PUT, change=lambda place: place[[1, 0, 2]], seen_too=False)

# A prompt that shows the odd one of ten alone, or keyframes that are none
ODD = {
    "turned_90": (BAR, tool(turn_deg=90)),
    "turned_back": (TURN, shows(turn("knob", -90))),
    "turned_half_as_far": (TURN, shows(turn("knob", 45))),
    "ended": (TAKE, ended_at_grasp),
    "slipped": (PUT, slipped),
    "pushed_by_less": (PUSH, shows(push("block", 0.06))),
    "in_the_other_order": (BOTH, shows(press(*BUTTONS[::-1]))),
}
for _name, (_skill, _fault) in ODD.items():
    case(f"shown_is_the_odd_one_{_name}", _skill, _fault, lambda k: k == 3, shown=(3,))
case("keyframes_far_apart", PUT, settings={"keyframes": {"rule": "uniform", "interval": 50}})
CELLS = [tried for tried in SEQUENCES if tried.__module__ == __name__]
