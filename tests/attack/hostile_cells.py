"""Sequences by an outsider: mistakes of cameras, tools, clocks and operators, judged by what a table's things become.

Each skill is asked without a mistake, too: `CONTROLS` must be right, and not stopped.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.trajectory import Trajectory
from tests.attack.cell import UP, Cell, Thing
from tests.attack.hostile_sequences import SEQUENCES, moves_wrongly, sequence
from tests.attack.hostile_skills import DOWN, RATE_HZ, flowing

TABLE_M = 0.78
START = {"position": [0.1, 0.0, 1.2], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}


@dataclass(frozen=True)
class Scene:
    """Where things are: (3,) m and degrees about the vertical by name; other rotations by `hands`."""

    places: dict
    yaws: dict

    def moved(self, *names, by_m=(0.0, 0.0, 0.0), turn_deg=0.0):
        """With these things, or all, elsewhere."""
        names = names or tuple(self.places)
        places = {n: p + np.array(by_m) if n in names else p for n, p in self.places.items()}
        yaws = {n: y + turn_deg if n in names else y for n, y in self.yaws.items()}
        return Scene(places, yaws)

    def hand(self, name):
        """Of fingers that point down and close across a thing."""
        return Rotation.from_euler("z", self.yaws[name], degrees=True) * DOWN


@dataclass(frozen=True)
class Demo:
    """One upload."""

    words: str
    scene: Scene
    trajectory: Trajectory
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

        def judged(actions):
            moved = [{**each, "position": _fingertips(each, tool_m)} for each in actions]
            return bool(self.done(self.cell(scene).carry_out(moved), scene))

        return judged


def _fingertips(action, tool_m):
    return np.array(action["position"]) - Rotation.from_quat(action["quaternion_xyzw"]).apply(tool_m)


# Skills


def recorded(stops):
    """From where the arm always starts."""
    return flowing([(START["position"], DOWN, stops[0][2]), *stops])


def over(place, height_m=0.1):
    return place + height_m * UP


def _take(name, lift_m=0.2):
    def stops(scene):
        place, hand = scene.places[name], scene.hand(name)
        return [(over(place), hand, 1), (place, hand, 0), (over(place, lift_m), hand, 0)]

    return stops


def _press(*names):
    def stops(scene):
        hand, listed = DOWN, []
        for name in names:
            place = scene.places[name]
            listed += [(over(place), hand, 0), (place, hand, 0), (over(place), hand, 0)]
        return listed

    return stops


def _put(name, goal, offset=(0.0, 0.0, 0.05), *, aligned=True, turns_with=True):
    """Takes a thing, and lets go of it at the goal (offset along its axes), turned as the goal is."""

    def stops(scene):
        hand = scene.hand(goal) if aligned else scene.hand(name)
        to = goal_of(scene, goal, offset, turns_with)
        return [*_take(name)(scene), (over(to, 0.15), hand, 0), (to, hand, 1), (over(to), hand, 1)]

    return stops


def goal_of(scene, goal, offset, turns_with=True):
    turn = Rotation.from_euler("z", scene.yaws[goal] if turns_with else 0.0, degrees=True)
    return scene.places[goal] + turn.apply(offset)


def _turn(name, degrees=90):
    def stops(scene):
        place, hand = scene.places[name], scene.hand(name)
        turned = [Rotation.from_euler("z", step, degrees=True) * hand for step in np.linspace(0, degrees, 4)]
        at = [(place, step, 0) for step in turned]
        return [(over(place), hand, 1), *at, (place, turned[-1], 1), (over(place), turned[-1], 1)]

    return stops


def _push(name, by_m=0.12):
    def stops(scene):
        place = scene.places[name]
        behind, ahead = (place + np.array([x, 0.0, 0.0]) for x in (-0.08, by_m - 0.08))
        return [(over(behind), DOWN, 0), (behind, DOWN, 0), (ahead, DOWN, 0), (over(ahead), DOWN, 0)]

    return stops


CUBE, PLATE = "red cube", "plate"
TAKE = Skill(f"pick up the {CUBE}", (CUBE, "bowl"), _take(CUBE), lambda c, s: c.took(CUBE))
BAR = Skill("pick up the bar", ("bar", "bowl"), _take("bar"), lambda c, s: c.took("bar"), long=("bar",))
PRESS = Skill("press the bell", ("bell", "lamp"), _press("bell"), lambda c, s: c.pressed("bell"))
BOTH = Skill(
    "press both buttons",
    ("green button", "white button"),
    _press("green button", "white button"),
    lambda c, s: c.pressed("green button", "white button"),
)
PUT = Skill(
    f"put the {CUBE} on the {PLATE}",
    (CUBE, PLATE),
    _put(CUBE, PLATE),
    lambda c, s: c.put(CUBE, over(s.places[PLATE], 0.05)),
)
FIXED = replace(PUT, fixed=(PLATE,))
AWAY = Skill(
    f"put the {CUBE} away",
    (CUBE, "bin"),
    _put(CUBE, "bin"),
    lambda c, s: c.put(CUBE, over(s.places["bin"], 0.05)),
    fixed=("bin",),
)
INSERT = Skill(
    "insert the peg into the socket",
    ("peg", "socket"),
    _put("peg", "socket", (0.0, 0.0, 0.02)),
    lambda c, s: c.put("peg", over(s.places["socket"], 0.02), s.yaws["socket"], 0.015),
    long=("peg",),
)
_BESIDE = (0.0, 0.13, 0.0)
BESIDE = Skill(
    f"put the {CUBE} beside the box",
    (CUBE, "box"),
    _put(CUBE, "box", _BESIDE, aligned=False, turns_with=False),
    lambda c, s: c.put(CUBE, goal_of(s, "box", _BESIDE, turns_with=False)),
)
TURN = Skill("turn the knob", ("knob", "lamp"), _turn("knob"), lambda c, s: abs(c.turned_deg - 90) < 15, long=("knob",))
PUSH = Skill(
    "push the block forward",
    ("block", "lamp"),
    _push("block"),
    lambda c, s: c.visited([s.places["block"] - [0.08, 0, 0], s.places["block"] + [0.04, 0, 0]]),
)
SKILLS = {
    "take": TAKE,
    "bar": BAR,
    "press": PRESS,
    "both": BOTH,
    "put": PUT,
    "fixed": FIXED,
    "away": AWAY,
    "insert": INSERT,
    "beside": BESIDE,
    "turn": TURN,
    "push": PUSH,
}


# Mistakes


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
        places = {n: pivot + scale * turn.apply(p - pivot) + (by_m or (0.0, 0.0, 0.0)) for n, p in scene.places.items()}
        return Scene(places, {n: y + turn_deg for n, y in scene.yaws.items()})

    return seen(change)


def turned_quaternions(change):
    """The quaternions of objects are computed wrongly from their yaw in degrees."""

    def fault(demo, *_):
        return replace(demo, quaternions={n: change(np.radians(y)) for n, y in demo.scene.yaws.items()})

    return fault


def clock(change):
    """The frames are changed: a trajectory of a trajectory."""
    return lambda demo, *_: replace(demo, trajectory=change(demo.trajectory))


def frames(t, kept):
    return Trajectory(
        t.joint_velocities_rad_s[kept], t.positions_m[kept], t.quaternions_xyzw[kept], t.gripper_open[kept]
    )


def joined(first, second):
    pairs = zip(
        (first.joint_velocities_rad_s, first.positions_m, first.quaternions_xyzw, first.gripper_open),
        (second.joint_velocities_rad_s, second.positions_m, second.quaternions_xyzw, second.gripper_open),
        strict=True,
    )
    return Trajectory(*(np.concatenate(pair) for pair in pairs))


def delayed(t, seconds):
    """The gripper is recorded so much later than the hand."""
    late = np.roll(t.gripper_open, round(RATE_HZ * seconds))
    n = abs(round(RATE_HZ * seconds))
    if seconds > 0:
        late[:n] = t.gripper_open[0]
    else:
        late[-n:] = t.gripper_open[-1]
    return replace(t, gripper_open=late)


def without_the_grasp(t):
    """A second and a half round the first switch was lost."""
    switch = int(np.flatnonzero(np.diff(t.gripper_open))[0])
    return frames(t, np.r_[0 : max(1, switch - 15), switch + 15 : len(t)])


def chunks_exchanged(t):
    """A ring buffer was written out from its middle."""
    n = len(t) // 2
    return frames(t, np.r_[n : len(t), 0:n])


def ended_at_grasp(t):
    switch = int(np.flatnonzero(np.diff(t.gripper_open))[0])
    return frames(t, slice(0, switch + 5))


def from_the_grasp_on(t):
    switch = int(np.flatnonzero(np.diff(t.gripper_open))[0])
    return frames(t, slice(switch + 1, None))


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


def shows(skill):
    """Another motion under the same words."""
    return lambda demo, *_: replace(
        demo, trajectory=recorded(skill.stops(demo.scene) if isinstance(skill, Skill) else skill(demo.scene))
    )


def after(demo, *_):
    """Objects as they are after the motion: what was carried is at the goal."""
    cell = PUT.cell(demo.scene).carry_out(
        [{"position": p, "quaternion_xyzw": r.as_quat(), "gripper_open": o} for p, r, o in PUT.stops(demo.scene)]
    )
    return replace(demo, scene=Scene({n: t.place for n, t in cell.things.items()}, demo.scene.yaws))


# Asking


def half(k):
    return k % 2 == 1


def every(k):
    return True


def last_four(k):
    return k >= 6


def third(k):
    return k % 3 == 2


CONTROLS: list[str] = []
QUESTIONS = 3


def told(a, demo):
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
    what,
    skill,
    fault=lambda demo, k: demo,
    wrong=half,
    *,
    number=10,
    asked=None,
    true=None,
    arm=START,
    settings=None,
    judge=None,
):
    """A sequence: `fault` in the recordings that are `wrong`, and a scene that is seen `asked` and is `true`."""

    def tried(a):
        a.random = np.random.default_rng(sum(map(ord, name)))
        if settings:
            a.configure(**settings)
        for k in range(number):
            demo = skill.demo(skill.draw(a))
            told(a, fault(demo, k) if wrong(k) else demo)
        for _ in range(QUESTIONS):
            scene = skill.draw(a)
            seen_as, scene = (asked(scene) if asked else scene), (true(scene) if true else scene)
            asks = {"model": "nearest", "task": a.task, "instruction": skill.words, "objects": things(seen_as)}
            answer = a.http.post("/predict", json={**asks, **({"end_effector": arm} if arm else {})})
            judged = judge(scene) if judge else skill.right(scene)
            if moves_wrongly(answer, judged):
                break
        return answer, judged

    return sequence(tried, name, what)


for _name, _skill in SKILLS.items():
    case(f"right_{_name}", "Nothing is wrong.", _skill)
    CONTROLS.append(f"right_{_name}")

FLANGE = tool(0.0, 0.0, -0.1)
CAMERA_ARM = tool(0.04, 0.0, -0.06)
for _skill_name in ("take", "put", "insert", "press"):
    case(f"two_tool_centers_{_skill_name}", "Half report the flange.", SKILLS[_skill_name], FLANGE)
case("three_tool_centers", "0, 3 and 6 cm up.", PUT, lambda d, k: tool(0, 0, -0.03 * (k % 3))(d), every)
case("tool_center_aside_in_half", "A bracket: the hand's point lies aside and up.", BAR, CAMERA_ARM)
case(
    "tool_center_aside_in_all",
    "The same in all, and the arm says it so too.",
    BAR,
    CAMERA_ARM,
    every,
    arm={"position": [0.14, 0.0, 1.26], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]},
    judge=lambda s: BAR.right(s, (0.04, 0.0, -0.06)),
)
case("tool_center_aside_in_all_but_the_question", "The arm's own point is asked.", BAR, CAMERA_ARM, every)
case("flange_turned_45_in_half", "The flange's x axis is 45 degrees from the fingers'.", BAR, tool(turn_deg=45))
case("flange_turned_45_in_all", "The arm that is asked says its fingers.", BAR, tool(turn_deg=45), every)
case("flange_turned_90_in_half", "A quarter turn about the approach.", BAR, tool(turn_deg=90))
case("flange_turned_20_in_half", "A little about the approach.", INSERT, tool(turn_deg=20))
case("tool_points_along_x_in_half", "The approach is x in half.", PUT, tool(turn_deg=90, axis="y"))
case("hand_conjugated_in_half", "Rotations of the base in the hand.", BAR, hand_changed(lambda p, r: (p, r.inv())))
case("hand_conjugated_in_all", "The same in all.", BAR, hand_changed(lambda p, r: (p, r.inv())), every)
case("left_handed_world_in_half", "y points the other way in half.", PUT, mirrored)
case("left_handed_world_in_all", "The same in all.", PUT, mirrored, every)
case("base_turned_180_in_half", "A second arm across the table.", PUT, frame(0.8, 0, 0, turn_deg=180))
case("base_turned_5_in_half", "The arm was mounted a little turned.", PUT, frame(turn_deg=5))
case("base_turned_12_in_all", "The same in all.", PUT, frame(turn_deg=12), every)
case("base_4_cm_beside_in_last_four", "The arm was moved between days.", PUT, frame(0.0, 0.04, 0.0), last_four)
case(
    "camera_bumped_6_cm", "After six recordings all things are seen 6 cm beside.", PUT, view(0.06, 0.0, 0.0), last_four
)
case("camera_turned_8_deg", "After six recordings.", INSERT, view(turn_deg=8), last_four)
case("camera_drifts", "1 cm more each recording.", PUT, seen(lambda s, k: s.moved(by_m=(0.01 * k, 0, 0))), every)
case("camera_bumped_before_the_question", "5 cm up and aside.", PUT, asked=lambda s: s.moved(by_m=(0.04, 0, 0.03)))
case("depth_10_percent_long_in_half", "A depth scale.", PUT, view(scale=1.1))
case(
    "depth_10_percent_long_in_all",
    "The same in all, and in the question.",
    PUT,
    view(scale=1.1),
    every,
    asked=lambda s: view(scale=1.1)(Demo("", s, None), 0).scene,
)
case(
    "lower_table_said_the_same",
    "Things on a table 8 cm lower are said to be on the other one.",
    PUT,
    lambda d, k: frame(0, 0, -0.08)(d),
)
case(
    "lower_table_said_rightly",
    "Half on a lower table; asked is a third one.",
    PUT,
    lambda d, k: seen(lambda s, _: s.moved(by_m=(0, 0, -0.08)))(frame(0, 0, -0.08)(d), k),
    asked=lambda s: s.moved(by_m=(0, 0, 0.12)),
    true=lambda s: s.moved(by_m=(0, 0, 0.12)),
)
case(
    "taller_cube_of_one_name",
    "From the seventh on the cube's center is 5 cm above where it is taken.",
    TAKE,
    seen(lambda s, k: s.moved(CUBE, by_m=(0, 0, 0.05))),
    last_four,
)
case(
    "taller_cube_in_the_question",
    "Its center is 4 cm above where it must be taken.",
    TAKE,
    asked=lambda s: s.moved(CUBE, by_m=(0, 0, 0.04)),
)
case(
    "origin_at_the_rim_in_half",
    "Another model of the plate: its origin is 8 cm along its x.",
    PUT,
    seen(lambda s, k: replace(s, places={**s.places, PLATE: goal_of(s, PLATE, (0.08, 0, 0))})),
)
case(
    "model_turned_30_in_half",
    "Another model of the peg, whose yaw is 30 degrees more.",
    INSERT,
    seen(lambda s, k: s.moved("peg", turn_deg=30)),
)
case(
    "model_turned_180_in_half",
    "A flip of the socket's yaw.",
    INSERT,
    seen(lambda s, k: s.moved("socket", turn_deg=180)),
)
case(
    "doubled_yaw_in_half",
    "The whole angle in a quaternion.",
    BAR,
    turned_quaternions(lambda r: [0, 0, np.sin(r), np.cos(r)]),
)
case(
    "negative_yaw_in_all",
    "World in object instead of object in world.",
    BAR,
    turned_quaternions(lambda r: [0, 0, -np.sin(r / 2), np.cos(r / 2)]),
    every,
)
case(
    "yaw_in_radians_read_as_degrees_in_half",
    "All objects seem hardly turned.",
    BAR,
    turned_quaternions(lambda r: [0, 0, np.sin(np.radians(r) / 2), np.cos(np.radians(r) / 2)]),
)
case(
    "finger_travel_in_half",
    "Half tell the way of one finger, above a bound that is set for two.",
    PUT,
    widths(lambda o, k: np.where(o, 0.04 if half(k) else 0.08, 0.005)),
    every,
    settings={"gripper_open_above_m": 0.06},
)
case(
    "width_in_another_unit_half_way",
    "Centimeters are decimeters in half.",
    PUT,
    widths(lambda o, k: np.where(o, 0.008 if half(k) else 0.08, 0.0)),
    every,
    settings={"gripper_open_above_m": 0.04},
)
case(
    "thick_thing_and_noisy_width",
    "Fingers close by 4 mm, and the width has 2 mm of noise.",
    TAKE,
    widths(lambda o, k: np.where(o, 0.08, 0.076) + np.random.default_rng(k).normal(0, 0.002, len(o))),
    every,
)
case("gripper_late_in_half", "0.7 s late.", TAKE, clock(lambda t: delayed(t, 0.7)))
case("gripper_late_in_all", "The fingers seem to close on the way up.", TAKE, clock(lambda t: delayed(t, 0.8)), every)
case("gripper_early_in_all", "They seem to close on the way down.", TAKE, clock(lambda t: delayed(t, -0.5)), every)
case(
    "gripper_late_in_all_of_a_put",
    "They seem to close and open on the way up.",
    PUT,
    clock(lambda t: delayed(t, 0.8)),
    every,
)
case("slipped_in_half", "The thing was lost on the way, and nobody looked.", PUT, clock(slipped))
case("slipped_in_all", "The same in all.", PUT, clock(slipped), every)
case("time_runs_twice_in_half", "The whole file is in it twice.", PUT, clock(lambda t: joined(t, t)))
case("time_runs_twice_in_all", "The same in all.", PRESS, clock(lambda t: joined(t, t)), every)
case("without_the_grasp_in_half", "1.5 s round the grasp were lost.", PUT, clock(without_the_grasp))
case("without_the_grasp_in_all", "The same in all.", TAKE, clock(without_the_grasp), every)
case("ring_buffer_in_half", "Second half first.", PUT, clock(chunks_exchanged))
case("ring_buffer_in_all", "The same in all.", PRESS, clock(chunks_exchanged), every)
case("ended_at_the_grasp_in_half", "Half without a lift.", TAKE, clock(ended_at_grasp))
case("ended_at_the_grasp_in_a_third", "A third without a lift.", TAKE, clock(ended_at_grasp), third)
case("in_the_hand_from_the_start", "Recorded from the grasp on.", PUT, clock(from_the_grasp_on), every)
case("in_the_hand_from_the_start_in_half", "The same in half.", PUT, clock(from_the_grasp_on))
case("things_as_they_are_afterwards", "The last frame's poses in all.", PUT, after, every)
case("things_as_they_are_afterwards_in_half", "In half.", PUT, after)


def _stale(skill, *names, which=every):
    """The pose of some things is that of the recording before."""

    def tried_name(kind):
        last = {}

        def fault(demo, k):
            before = last.get("scene", demo.scene)
            last["scene"] = demo.scene
            if not which(k):
                return demo
            places = {n: before.places[n] if n in names else p for n, p in demo.scene.places.items()}
            return replace(demo, scene=Scene(places, demo.scene.yaws))

        return fault

    return tried_name("stale")


case("goal_stale_in_all", "The plate's pose is the last recording's.", PUT, _stale(PUT, PLATE), every)
case("goal_stale_in_half", "The same in half.", PUT, _stale(PUT, PLATE, which=half), every)
case("goal_stale_in_a_third", "The same in a third.", PUT, _stale(PUT, PLATE, which=third), every)
case(
    "goal_never_moved",
    "The plate was always in one place, and is asked 20 cm beside.",
    FIXED,
    asked=lambda s: s.moved(PLATE, by_m=(-0.2, 0.05, 0)),
    true=lambda s: s.moved(PLATE, by_m=(-0.2, 0.05, 0)),
)
case(
    "bin_never_moved",
    "The same with a bin that no word names.",
    AWAY,
    asked=lambda s: s.moved("bin", by_m=(-0.2, 0.05, 0)),
    true=lambda s: s.moved("bin", by_m=(-0.2, 0.05, 0)),
)
case(
    "bin_never_moved_4_cm",
    "4 cm beside.",
    AWAY,
    asked=lambda s: s.moved("bin", by_m=(-0.04, 0, 0)),
    true=lambda s: s.moved("bin", by_m=(-0.04, 0, 0)),
)
SOCKET = replace(INSERT, fixed=("socket",))
case(
    "socket_never_turned",
    "It is turned by 40 degrees in the question.",
    SOCKET,
    asked=lambda s: s.moved("socket", turn_deg=40),
    true=lambda s: s.moved("socket", turn_deg=40),
)
case(
    "peg_with_a_key_seen_a_quarter_turned",
    "The estimator takes a face for the next one.",
    INSERT,
    asked=lambda s: s.moved("peg", turn_deg=90),
)
case(
    "peg_with_a_key_said_to_be_square",
    "`yaw_symmetry_deg` 90; the key is turned.",
    INSERT,
    settings={"yaw_symmetry_deg": {"peg": 90}},
    asked=lambda s: s.moved("peg", turn_deg=80),
    true=lambda s: s.moved("peg", turn_deg=80),
)
case(
    "socket_said_to_be_round",
    "`yaw_symmetry_deg` 0 of a socket with a key.",
    INSERT,
    settings={"yaw_symmetry_deg": {"socket": 0}},
)
TURNED = lambda s: _put("peg", "socket", (0, 0, 0.02))(s.moved("socket", turn_deg=60))  # noqa: E731
case("peg_inserted_60_degrees_otherwise_in_half", "The key is elsewhere in half.", INSERT, shows(TURNED))
case(
    "peg_inserted_25_degrees_otherwise_in_half",
    "A little elsewhere in half.",
    INSERT,
    shows(lambda s: _put("peg", "socket", (0, 0, 0.02))(s.moved("socket", turn_deg=25))),
)
case(
    "operator_across_the_table",
    "To the left of the box, as each of two operators sees it.",
    BESIDE,
    shows(_put(CUBE, "box", (0.0, -0.13, 0.0), aligned=False, turns_with=False)),
)
case(
    "beside_in_the_other_axis_in_half",
    "In front of it in half.",
    BESIDE,
    shows(_put(CUBE, "box", (-0.13, 0.0, 0.0), aligned=False, turns_with=False)),
)
case("order_of_two_buttons", "White first in half.", BOTH, shows(_press("white button", "green button")))
case(
    "order_of_two_buttons_in_a_third",
    "White first in a third.",
    BOTH,
    shows(_press("white button", "green button")),
    third,
)
case("one_of_two_buttons_in_half", "The second one is left out in half.", BOTH, shows(_press("green button")))
case("clockwise_in_half", "The knob is turned the other way in half.", TURN, shows(_turn("knob", -90)))
case("half_as_far_in_half", "Turned by 45 degrees in half.", TURN, shows(_turn("knob", 45)))
case("twice_as_far_in_half", "Turned by 180 degrees in half.", TURN, shows(_turn("knob", 180)))
case("a_pick_is_pushed_in_half", "Push under the same words.", TAKE, shows(_push(CUBE)))
case("pushed_by_less_in_half", "A push of 6 cm instead of 12.", PUSH, shows(_push("block", 0.06)))
case("pushed_the_other_way_in_half", "Towards the robot.", PUSH, shows(_push("block", -0.12)))
INCHES = 1 / 0.0254


def in_inches(demo, *_):
    """Everything."""
    scene = Scene({n: INCHES * p for n, p in demo.scene.places.items()}, demo.scene.yaws)
    return replace(frame(scale=INCHES)(demo), scene=scene)


case("hand_in_inches_in_half", "Objects are in meters.", TAKE, frame(scale=INCHES))
case("all_in_inches_in_half", "Hand and objects.", TAKE, in_inches)
case("all_in_inches", "Hand and objects in all, the question in meters.", TAKE, in_inches, every)
case(
    "question_in_inches",
    "Taught in meters.",
    TAKE,
    asked=lambda s: Scene({n: INCHES * p for n, p in s.places.items()}, s.yaws),
)
case(
    "question_in_feet",
    "Taught in meters.",
    TAKE,
    asked=lambda s: Scene({n: 3.28 * p for n, p in s.places.items()}, s.yaws),
)
case(
    "objects_above_the_table_in_half",
    "z from the table in half.",
    PUT,
    seen(lambda s, k: s.moved(by_m=(0, 0, -TABLE_M))),
)
case(
    "objects_above_the_table_in_the_question", "z from the table.", PUT, asked=lambda s: s.moved(by_m=(0, 0, -TABLE_M))
)
case(
    "x_and_y_exchanged_in_half",
    "Of objects.",
    PUT,
    seen(lambda s, k: replace(s, places={n: p[[1, 0, 2]] for n, p in s.places.items()})),
)
case(
    "x_and_y_exchanged_in_the_question",
    "Of objects.",
    PUT,
    asked=lambda s: replace(s, places={n: p[[1, 0, 2]] for n, p in s.places.items()}),
)
case(
    "already_there",
    "The cube lies on the plate.",
    PUT,
    asked=lambda s: replace(s, places={**s.places, CUBE: over(s.places[PLATE], 0.05)}),
    judge=lambda s: lambda actions: False,
)
CELLS = [tried for tried in SEQUENCES if tried.__module__ == __name__]
