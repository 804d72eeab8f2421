"""What is doubtful about demonstrations, a scene or an answer: residuals against the skill that are too large.

Every doubt has a probability or nats of evidence; its severity follows from them. A robot stops at a danger.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import ndtri, stdtr

from app.pipeline.skill import script
from app.pipeline.skill.choice import FLOOR_M
from app.pipeline.skill.density import ALL, EXACT, HAND, SceneDensity, Surprise, repeated
from app.pipeline.skill.evidence import Posterior
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.frames import is_named
from app.pipeline.skill.hypotheses import explained
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.rows import COORDINATES, Row
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.ways import Which, two_kinds
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

Severity = Literal["info", "warning", "danger"]

# Calibrated on right and wrong cases of the adversary, seeds 7300 to 7401: right ones are stopped in 1 of 50
DANGER_P, DOUBT_P = 1e-3, 0.01  # of a scene's coordinate,
UNFOLLOWED_P = 1e-6  # of one that no row follows and no words name
EXCHANGED = 6.0  # nats by which a scene is more probable with two names exchanged
UNLIKELY = -4.0  # log probability of a recording
SHARE = 0.34  # of recordings that are unlike what words say, or unlike the others
OTHER_OBJECT = 1.0  # nats a recording by which a row follows something else than words say
CLOCK = 2.9  # nats a recording for another clock of the gripper
EXPLAINED = 8.0  # nats for a fault of all recordings
REPEATED = 0.15  # share of recordings with an object exactly where another recording has it
# What an act may be off is not known: lognormal around these. Demonstrations that are off by as much have succeeded
TOLERANCE_M, TOLERANCE_RAD = 0.035, np.radians(20)
TOLERANCES = np.exp(0.5 * ndtri((np.arange(10) + 0.5) / 10))  # of which demonstrations say nothing
EXACTLY = 0.6  # of the tolerance where demonstrations are of two kinds, each exact
FREE = 2.0  # times as far where a hand lets go: things are put down anywhere
HIDDEN = 0.3  # prior probability that a place that scatters follows something that is not seen,
HIDDEN_TURN = 0.6  # and a rotation: things without a measured rotation are the rule, hands that turn at will are not
FAILS = 0.2  # probability that an act fails: of cases without another doubt 17 % failed to there, 27 % beyond
BROKEN_M = 0.05  # scatter of ends and starts in the midst of a way
SHIFTS_S = np.array([*np.arange(-8, -1), *np.arange(2, 9)]) / 5  # of the gripper's clock: 0.4 to 1.6 s


@dataclass(frozen=True)
class Doubt:
    """Something improbable, with what to do about it.

    Attributes:
        surprise: the coordinate that it is about, where it is about one.
    """

    code: str
    severity: Severity
    message: str
    surprise: Surprise | None = None

    @property
    def danger(self) -> bool:
        """Whether a robot stops."""
        return self.severity == "danger"


def of_demonstrations(plans: Sequence[Plan], recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Yield the doubts that depend on demonstrations only, causes first."""
    usual = next((plan for plan in plans if not plan.when), plans[0])
    used = [plan for plan in plans if plan.when or plan is usual]
    for plan in used:
        yield from _faults(plan)
    yield from _scripts(plans, [item for plan in plans if plan not in used for item in plan.members])
    yield from _events(plans, recordings)
    for plan in used:
        yield from _objects(plan)
        yield from _clock(plan)
        yield from _acts(plan)
    yield from _repeated(recordings)


def of_scene(plan: Plan, density: SceneDensity, scene: Scene) -> Iterator[Doubt]:
    """Yield the doubts about a scene that a plan is placed in."""
    matter = _followed(plan, scene)
    for one in density.surprises(scene, DOUBT_P):
        other = one.coordinate.partition(" from ")[2]
        matters = one.about in matter and (not other or other in matter)
        danger = one.p < (DANGER_P if matters else UNFOLLOWED_P)
        yield Doubt("unusual-scene", "danger" if danger else "warning", _unusual(one), one)
    for first, second, gain in density.exchanged(scene):
        if gain > EXCHANGED and {first, second} & matter:
            said = f"{first} and {second} stand where demonstrations have the other: check which is which"
            yield Doubt("names-exchanged", "danger", said)
    for name, what in repeated(density.scenes, scene, density.scenes.shape[0]):
        said = f"{name} {what}, which no measurement does: check that its pose is measured anew"
        yield Doubt("measured-twice", "danger" if name in matter else "warning", said)
    for condition in plan.when:
        if not condition.is_clear(scene):
            said = f"{condition.quantity.one} stands between the scenes of two ways: record some here"
            yield Doubt("way-unclear", "warning", said)


def of_answer(rows: Sequence[Row], actions: Sequence[EndEffectorAction], scene: Scene, most_p: float) -> list[Surprise]:
    """Return the coordinates of actions that are less probable than `most_p` in the rows that they carry out."""
    found = []
    for k, (row, action) in enumerate(zip(rows, actions, strict=False)):
        off, p = row.residual(action, scene), row.surprise(action, scene)
        for c in np.flatnonzero(p < most_p):
            half = 2 * float(row.scale[c])
            found.append(Surprise(f"action {k}", COORDINATES[c], float(off[c]), (-half, half), float(p[c])))
    return sorted(found, key=lambda one: one.p)


def of_left_out(one: Surprise) -> Doubt:
    """Return the doubt about a demonstration that is unlike the others; the skill goes by the others."""
    low, high = one.usual
    said = f"demonstration {one.about}: {one.coordinate} is {one.value:.3f}, the others have {low:.3f} to {high:.3f}"
    return Doubt("unusual-demonstration", "warning", f"{said}: look at it, and leave it out if it is wrong", one)


def _followed(plan: Plan, scene: Scene) -> set[str]:
    """Return the names of what a plan follows or words name, with the hand."""
    keys = frozenset().union(*(row.frame.objects for row in plan.rows))
    named = {name for name, key in zip(scene.names, scene.keys, strict=True) if key in keys or is_named(key)}
    return named | {HAND, ALL}


def _unusual(one: Surprise) -> str:
    scale, unit = (180 / np.pi, " degrees") if one.coordinate == "yaw" else (1.0, " m")
    value, low, high = (scale * number for number in (one.value, *one.usual))
    unit = "" if one.coordinate.startswith("tilt") else unit
    said = f"{one.about}: {one.coordinate} is {value:.3f}{unit}, demonstrations have {low:.3f} to {high:.3f}{unit}"
    return f"{said}: check its pose, or record demonstrations with scenes like this one"


def _faults(plan: Plan) -> Iterator[Doubt]:
    """Yield the fault that explains all recordings of a plan better than what they say."""
    if len(plan.members) < 2:
        return
    for fault, gain in explained(plan.shown.taking(plan.shown.acts))[:1]:
        said = f"probably {fault.says} in all demonstrations (by {gain:.0f} nats of evidence): {fault.remedy}"
        yield Doubt(fault.code, "danger" if gain > EXPLAINED else "info", said)


def _scripts(plans: Sequence[Plan], others: Sequence[Recording]) -> Iterator[Doubt]:
    """Yield a doubt where recordings switch the gripper otherwise and nothing of the scene says when."""
    number = sum(len(plan.members) for plan in plans)
    if others:
        names = ", ".join(item.id for item in others)
        said = f"demonstrations {names} of {number} switch the gripper otherwise, and nothing of the scene says when"
        severity: Severity = "danger" if len(others) > SHARE * number else "info"
        yield Doubt("several-scripts", severity, f"{said}: they are not used; leave them out, or record them anew")


def _events(plans: Sequence[Plan], recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Yield a doubt where recorded events are not those that words ask for."""
    excused = {item.id: _excused(plan) for plan in plans for item in plan.members}
    said: Counter[str] = Counter()
    inverted = 0
    for item in recordings:
        found = [fault for fault in script.faults(item) if fault.name not in excused.get(item.id, set())]
        if (nats := sum(fault.nats for fault in found)) <= UNLIKELY:
            said[" and ".join(fault.name for fault in found)] += 1
            turned = script.faults(item, inverted=True)
            inverted += sum(fault.nats for fault in turned) > nats - UNLIKELY / 2
    if 2 * inverted > len(recordings):
        yield Doubt("gripper-inverted", "danger", "the gripper is probably inverted: send 1 where it is open")
    if total := sum(said.values()):
        what, _ = said.most_common(1)[0]
        message = f"{total} of {len(recordings)} demonstrations: the gripper or the hand {what}, unlike what words ask"
        severity: Severity = "danger" if total > SHARE * len(recordings) else "info"
        yield Doubt("unexpected-events", severity, f"{message}: check the gripper, or record them anew")


def _objects(plan: Plan) -> Iterator[Doubt]:
    """Yield a doubt where rows follow another object than words say."""
    rows, item = plan.shown, plan.members[0]
    role = dict(zip(item.scene.names, item.scene.keys, strict=True))
    named = {key: name for name, key in role.items()}
    wanted = script.expected(item.order)
    _, pairs = script.matched(wanted, script.events(item), item.scene.names)
    for one, event in zip(wanted, pairs, strict=True):
        if event is None or event >= len(rows.switches):
            continue
        row = plan.rows[rows.switches[event]]
        keys = [role[name] for name in one.objects if role.get(name) in row.rivals]
        if _gap(row, keys) > OTHER_OBJECT * rows.number:
            yield _other(named[_best(row)], one.objects[0])
    if not wanted and item.order.objects:
        acts, keys = [plan.rows[k] for k in rows.acts], [key for key in rows.scenes.keys if is_named(key)]
        if min(_gap(row, keys) for row in acts) > OTHER_OBJECT * rows.number:
            yield _other(named[_best(acts[-1])], " or ".join(item.order.objects))


def _best(row: Row) -> str:
    """Return the key of the object that a row rather follows than any other."""
    return max(row.rivals, key=lambda key: row.rivals[key])


def _gap(row: Row, keys: Sequence[str]) -> float:
    """Return the nats by which a row rather follows the best of all objects than the best of these."""
    return max(row.rivals.values(), default=0.0) - max((row.rivals[key] for key in keys), default=np.inf)


def _other(follows: str, named: str) -> Doubt:
    said = f"the hand follows {follows} where words say {named}: check the instruction and the objects' names"
    return Doubt("other-object", "danger", said)


def _clock(plan: Plan) -> Iterator[Doubt]:
    """Yield a doubt where the gripper's switches fit the motion better some time earlier or later."""
    pairs = [m for m in plan.members if any(e.opens for e in script.events(m)) or script.expected(m.order)]
    if 2 * len(pairs) <= len(plan.members):
        return
    now = np.array([script.fits(item, 0.0) for item in pairs])
    gains = [float(np.median([script.fits(item, s) for item in pairs] - now)) for s in SHIFTS_S]
    best = int(np.argmax(gains))
    if gains[best] > CLOCK:
        said = f"the gripper fits the motion better {SHIFTS_S[best]:+.1f} s later: send it by the clock of the poses"
        yield Doubt("gripper-clock", "danger", said)


def _excused(plan: Plan) -> set[str]:
    """Return faults that are none: recordings start or end in motion at a common place, where something made them."""
    paths = [item.motion.trajectory.positions_m for item in plan.members]
    found: set[str] = set()
    last, switches = plan.rows[-1], plan.shown.switches
    if min(len(path) for path in paths) < 2:
        return found
    if _common(last.residuals[:3], [float(np.linalg.norm(path[-1] - path[-2])) for path in paths]):
        found.add(script.ENDS_MOVING)
        held = plan.rows[switches[-1]].frame.objects if switches and not last.gripper_open else frozenset()
        moving = np.median([item.motion.hand_speeds_m_s[-1] for item in plan.members]) > script.MOVING_M_S
        if moving and last.frame.objects - held:
            found.add(script.HOLDS)
    if _common(plan.shown.scenes.start.T, [float(np.linalg.norm(path[1] - path[0])) for path in paths]):
        found.add(script.STARTS_MOVING)
    return found


def _common(places: Array, steps_m: Sequence[float]) -> bool:
    """Return whether places (3, N) are rather one, blurred by steps between frames, than anywhere on a way."""
    if places.shape[1] < 2:
        return False
    scatter, one = places.std(axis=1, ddof=1), float(np.hypot(FLOOR_M, np.median(steps_m)))
    return bool((np.log(BROKEN_M / one) + scatter**2 / 2 * (BROKEN_M**-2 - one**-2)).sum() > 0)


def _acts(plan: Plan) -> Iterator[Doubt]:
    """Yield a doubt for each row that is too uncertain to act."""
    if len(plan.members) < 2:
        return
    residuals = np.stack([plan.rows[k].residuals for k in plan.shown.acts])
    gain, second = two_kinds(residuals, int(np.ceil(SHARE * len(plan.members))))
    grips = set(plan.shown.switches) if _grips(plan) else set()
    elsewhere = {*plan.shown.acts, *(k for k, row in enumerate(plan.rows) if row.frame.objects)} - grips
    fails = {k: _fails_at(plan, k, gain) for k in sorted({*elsewhere, *grips})}
    surest = min(elsewhere - set(plan.shown.switches), key=lambda k: fails[k], default=None)  # there the hand acts
    doubtful = [k for k in fails if fails[k] > FAILS and (k in grips or k == surest)]
    for k in doubtful:
        row = plan.rows[k]
        of, off = " and ".join(sorted(row.frame.objects)) or "the world", row.scale
        said = f"row {k} scatters by {1000 * off[:3].max():.0f} mm and {np.degrees(off[3:].max()):.0f} degrees"
        message = f"{said} as seen from {of}, and fails in {fails[k]:.0%}: record what it follows, or more alike"
        yield Doubt("uncertain-act", "danger", message)
    if second.any() and gain > 0:
        said = f"demonstrations {', '.join(_ids(plan, second))} act in another way than the others"
        yield Doubt("several-ways", "info", f"{said} (by {gain:.0f} nats of evidence)")
        if doubtful:
            yield from _of_some(plan, second)


def _grips(plan: Plan) -> bool:
    """Return whether the gripper's switches are acts; a single one that words do not ask for closes a fist anywhere."""
    return len(plan.shown.switches) > 1 or bool(script.expected(plan.members[0].order))


def _of_some(plan: Plan, second: Which) -> Iterator[Doubt]:
    for fault, gain in explained(plan.shown.taking(plan.shown.acts), second)[:1]:
        said = f"probably {fault.says} in {', '.join(_ids(plan, second))} (by {gain:.0f} nats): {fault.remedy}"
        yield Doubt(fault.code, "info", said)


def _ids(plan: Plan, which: Which) -> list[str]:
    return [item.id for item, member in zip(plan.members, which, strict=True) if member]


def _fails_at(plan: Plan, k: int, gain: float) -> float:
    """Return the probability that the act of a row fails."""
    row = plan.rows[k]
    free = FREE if row.gripper_open else 1.0
    blur = _blur(plan, k) if k in plan.shown.switches else 0.0
    place, turn = (row.posterior.at((slice(first, first + 3),)) for first in (0, 3))
    fails = _fails(place, free * TOLERANCE_M, _hidden(HIDDEN, gain), HIDDEN, blur)
    return max(fails, _fails(turn, free * TOLERANCE_RAD, _hidden(HIDDEN_TURN, gain), HIDDEN_TURN, 0.0))


def _hidden(prior: float, gain: float) -> float:
    """Return the probability that a row follows something hidden, where two kinds explain `gain` nats more than one."""
    return float(1 / (1 + (1 / prior - 1) * np.exp(-np.clip(gain, 0, 100))))


def _fails(of: Posterior, tolerance: float, hidden: float, prior: float, blur: float) -> float:
    """Return the largest probability that one of three coordinates is off by more than is tolerated.

    What scatters is mostly noise, of which the mean is free. Or it follows something hidden, and then a scene is off as
    a demonstration is.

    Args:
        hidden: probability of that, and before demonstrations of two kinds were found, `prior`.
        blur: m by which the recorded place of a switch is not known.
    """
    number = of.kept.shape[-1]
    elsewhere = (number - of.number) / (number + 1)

    def beyond(times: float, *, of_mean: bool) -> Array:
        scale = np.hypot(of.scale(of_mean=of_mean), blur)
        found: Array = 2 * stdtr(of.dof, -times * tolerance * TOLERANCES[:, None] / scale).mean(axis=0)
        return found

    off = prior * beyond(1, of_mean=False) + (hidden - prior) * beyond(EXACTLY, of_mean=False)
    return float(((1 - elsewhere) * off + elsewhere * hidden + (1 - hidden) * beyond(1, of_mean=True)).max())


def _blur(plan: Plan, k: int) -> float:
    """Return half of what the hand moves, in most recordings, between a row's frame and the nearer one beside it."""
    middle = float(np.median(_gaps(plan, k)))
    return middle / 2 if np.isfinite(middle) else 0.0


def _gaps(plan: Plan, k: int) -> list[float]:
    """Return how far (N,) the hand moves between a row's frame and the nearer one beside it."""
    gaps = []
    for item, frame in zip(plan.members, plan.shown.frames[:, k].tolist(), strict=True):
        steps = np.linalg.norm(np.diff(item.motion.trajectory.positions_m, axis=0), axis=1)
        gaps.append(float(steps[max(frame - 1, 0) : frame + 1].min(initial=np.inf)))
    return gaps


def _repeated(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Yield a doubt for each object that several recordings have in exactly one place, though it moves in others."""
    scenes = [item.scene.by_name() for item in recordings]
    for name in sorted(set.intersection(*(set(scene.names) for scene in scenes))):
        places = np.array([scene.place[scene.keys.index(name)] for scene in scenes])
        if np.ptp(places, axis=0).max() < EXACT:
            continue
        again = [np.abs(places[n] - places[:n]).max(axis=1).min() < EXACT for n in range(1, len(places))]
        if sum(again) > REPEATED * len(places):
            said = f"{name} is in {sum(again)} demonstrations exactly where another has it: check that poses are new"
            yield Doubt("measured-twice", "danger", said)
