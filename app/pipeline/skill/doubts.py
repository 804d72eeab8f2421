"""What is doubtful about demonstrations, a scene or an answer: residuals against the skill that are too large.

Every doubt has a p, how probable what is seen is if nothing is wrong; its severity follows from p, see
`app.pipeline.finding`.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.special import ndtr, ndtri, stdtr

from app.pipeline.finding import LEVELS, Finding, finding, without_repeats
from app.pipeline.names import folded_name
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
from app.pipeline.skill.ways import LEAST, Which, two_kinds
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

CAUSES = ("another-convention", "names-exchanged", "measured-twice")  # after which everything else is doubtful, too
SHARE = 0.34  # of recordings that are unlike what words say, or unlike the others
OTHER_OBJECT = 1.0  # nats a recording by which a row follows something else than words say
CLOCK = 2.9  # nats a recording for another clock of the gripper
REPEATED = 0.15  # share of recordings with an object exactly where another recording has it
# What an act may be off is not known: lognormal around these. Demonstrations that are off by as much have succeeded
TOLERANCE_M, TOLERANCE_RAD = 0.035, np.radians(20)
TOLERANCES = np.exp(0.5 * ndtri((np.arange(10) + 0.5) / 10))  # of which demonstrations say nothing
EXACTLY = 0.6  # of the tolerance where demonstrations are of two kinds, each exact
FREE = 2.0  # times as far where a hand lets go: things are put down anywhere
HIDDEN = 0.3  # prior probability that a place that scatters follows something that is not seen,
HIDDEN_TURN = 0.6  # and a rotation: things without a measured rotation are the rule, hands that turn at will are not
FAILS = 1 - LEVELS["uncertain-act"].danger  # probability that an act fails
SIZE_M, SIZES = 0.04, 0.35  # of a thing and what may be in the hand: median, and spread of the logarithm
NEARER = 0.5  # of the least distance in recordings
PARTS = 50  # of a way between two actions
BROKEN_M = 0.05  # scatter of ends and starts in the midst of a way
SHIFTS_S = np.array([*np.arange(-8, -1), *np.arange(2, 9)]) / 5  # of the gripper's clock: 0.4 to 1.6 s


def of_demonstrations(
    plans: Sequence[Plan], used: Sequence[Plan], recordings: Sequence[Recording]
) -> Iterator[Finding]:
    """Yield the doubts that depend on demonstrations only, causes first; `used` are plans that scenes call for."""
    if (number := len(recordings)) < LEAST:
        said = (
            f"{number} demonstration{'s show' if number > 1 else ' shows'} not yet what each row follows: record more"
        )
        yield finding("few-demonstrations", 1.0, said, "demonstrations", demonstrations=number)
    for plan in used:
        yield from _faults(plan)
    yield from _scripts(plans, [item for plan in plans if plan not in used for item in plan.members])
    for plan in used:
        yield from _objects(plan)
    yield from _events(plans, recordings)
    for plan in used:
        yield from _clock(plan)
        yield from _acts(plan)
        yield from alike(plan, plan.members[0].scene)
    yield from _repeated(recordings)


def without_effects(found: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return doubts about demonstrations without those that a cause among them explains: one cause is one doubt."""
    caused = any(one.danger and one.code in CAUSES for one in found)
    return without_repeats(one for one in found if not caused or one.code in CAUSES or one.severity == "info")


def alike(plan: Plan, scene: Scene) -> Iterator[Finding]:
    """Yield what objects of a scene turned out to look alike after a turn though nobody has said so."""
    told = dict(zip(scene.keys, zip(scene.names, scene.symmetry, strict=True), strict=True))
    for key, period in zip(plan.shown.scenes.keys, plan.shown.scenes.symmetry, strict=True):
        name, said = told.get(key, ("", None))
        if name and said is None and period is not None:
            after = f"after a turn by {period:g} degrees" if period else "at every yaw"
            message = f"demonstrations take {name} as if it looked the same {after}, and so do answers"
            remedy = f'if its side matters, set yaw_symmetry_deg to {{"{name}": 360}}'
            yield finding("symmetry-shown", 1.0, f"{message}: {remedy}", f"objects[{name}]", symmetry_deg=period)


def of_scene(plan: Plan, density: SceneDensity, scene: Scene) -> Iterator[Finding]:
    """Yield the doubts about a scene that a plan is placed in; of one object's coordinates the least probable."""
    matter = _matter(plan, scene)
    exchanged = []
    for first, second, gain in density.exchanged(scene):
        said = f"{first} and {second} stand where demonstrations have the other: check which is which"
        doubt = finding("names-exchanged", float(np.exp(-gain)), said, f"objects[{first}]")
        if doubt.danger and {first, second} & matter:
            exchanged.append((first, second))
            yield doubt
    for name, what in repeated(density.scenes, scene, density.scenes.shape[0]):
        said = f"{name} {what}, which no measurement does: check that its pose is measured anew"
        yield finding("measured-twice", 0.0 if name in matter else 1.0, said, f"objects[{name}]")
    explained = {name for pair in exchanged for name in pair}
    for one in _by_cause(_that_matter(density, scene, matter), explained):
        yield finding("unusual-scene", one.p, _unusual(one), _where(one.about), **_numbers(one))
    for condition in plan.when:
        if not condition.is_clear(scene):
            said = f"{condition.quantity.one} stands between the scenes of two ways: record some here"
            yield finding("several-ways", 0.5, said, _where(condition.quantity.one))


def _matter(plan: Plan, scene: Scene) -> set[str]:
    """Return the names of what rows may follow or words name, with the hand: where it is elsewhere the act may fail."""
    found = followed(plan, scene)
    for name, key in zip(scene.names, scene.keys, strict=True):
        gaps = [row.rivals[key] - row.log_evidence for row in plan.rows if key in row.rivals]
        if max(gaps, default=-np.inf) > np.log(FAILS):
            found.add(name)
    return found


def _that_matter(density: SceneDensity, scene: Scene, matter: set[str]) -> list[Surprise]:
    return [one for one in density.surprises(scene, LEVELS["unusual-scene"].warning) if matter >= set(_things(one))]


def _by_cause(found: Sequence[Surprise], explained: set[str]) -> list[Surprise]:
    """Return one surprise for each thing: an object that is elsewhere in the world is elsewhere for all others, too."""
    named: dict[str, Surprise] = {}
    for one in sorted(found, key=lambda one: (len(_things(one)), one.about == ALL, one.p)):
        if explained.intersection(_things(one)):
            continue
        of = next((name for name in (*_things(one), *(named if one.about == ALL else ())) if name in named), one.about)
        named[of] = named[of]._replace(p=min(named[of].p, one.p)) if of in named else one
    return sorted(named.values(), key=lambda one: one.p)


def _things(one: Surprise) -> tuple[str, ...]:
    """Return the names of what a surprise is about: an object, or one as seen from another."""
    other = one.coordinate.partition(" from ")[2]
    return (one.about, other) if other else (one.about,)


def _where(about: str) -> str:
    return {HAND: "end_effector", ALL: "objects"}.get(about, f"objects[{about}]")


def _numbers(one: Surprise) -> dict[str, float]:
    return {"value": one.value, "low": one.usual[0], "high": one.usual[1]}


def of_answer(rows: Sequence[Row], actions: Sequence[EndEffectorAction], scene: Scene, most_p: float) -> list[Surprise]:
    """Return the coordinates of actions that are less probable than `most_p` in the rows that they carry out."""
    found = []
    for k, (row, action) in enumerate(zip(rows, actions, strict=False)):
        off, p = row.residual(action, scene), row.surprise(action, scene)
        for c in np.flatnonzero(p < most_p):
            half = 2 * float(row.scale[c])
            found.append(Surprise(f"action {k}", COORDINATES[c], float(off[c]), (-half, half), float(p[c])))
    return sorted(found, key=lambda one: one.p)


def of_way(
    scene: Scene, touched: Collection[str], actions: Sequence[EndEffectorAction], recordings: Sequence[Recording]
) -> Iterator[Finding]:
    """Yield a doubt for each object that the hand passes much nearer than in any recording.

    Args:
        touched: names of objects that the hand is to be near to.
    """
    stops = np.array([action.position_m for action in actions])
    path = _densely(np.vstack([scene.start, stops]) if scene.knows_start else stops)
    for name, place in zip(scene.names, scene.place, strict=True):
        if name in touched:
            continue
        shown = [item.passed_m[name] for item in recordings if name in item.passed_m]
        near, least = float(np.linalg.norm(path - place, axis=1).min()), min(shown, default=np.inf)
        if near > min(NEARER * least, least - SIZE_M):
            continue
        p = float(ndtr(np.log(near / SIZE_M) / SIZES))
        kept = f"demonstrations kept {100 * least:.0f} cm" if shown else "demonstrations do not have it"
        said = f"the hand passes {100 * near:.1f} cm from the middle of {name}, {kept}: it or what it holds may hit it"
        one = finding("passes-close", p, f"{said}; move it away, or record a way around it", _where(name), off_m=near)
        if one.severity != "info":
            yield one


def _densely(stops: Array) -> Array:
    """Return places (P, 3) on the straight way through stops (K, 3)."""
    parts = [one + np.linspace(0, 1, PARTS)[:, None] * (other - one) for one, other in pairwise(stops)]
    return np.vstack([stops[:1], *parts])


def of_left_out(one: Surprise) -> Finding:
    """Return the doubt about a demonstration that is unlike the others; the skill goes by the others."""
    said = f"demonstration {one.about}: {_ranged(one)}: look at it, and leave it out if it is wrong"
    return finding("unusual-demonstration", one.p, said, f"episodes[{one.about}]", **_numbers(one))


def keys_of(plan: Plan) -> frozenset[str]:
    """Return the keys of the objects that a plan's rows follow or its condition is about."""
    asked = {key for condition in plan.when for key in (condition.quantity.one, condition.quantity.other) if key}
    return frozenset(asked).union(*(row.frame.objects for row in plan.rows))


def followed(plan: Plan, scene: Scene) -> set[str]:
    """Return the names of what a plan follows or words name, with the hand."""
    keys = keys_of(plan)
    named = {name for name, key in zip(scene.names, scene.keys, strict=True) if key in keys or is_named(key)}
    return named | {HAND, ALL}


def _unusual(one: Surprise) -> str:
    """Return object, coordinate, value, usual range and what to do."""
    remedy = "check its pose, or record demonstrations in scenes like this one"
    if one.about == HAND:
        remedy = (
            "send `end_effector` as recordings have it (meters, x y z w, the same point and frame), or move the hand"
        )
    return f"{one.about}: {_ranged(one)}: {remedy}"


def _ranged(one: Surprise) -> str:
    """Return a coordinate with its value and its usual range."""
    turned = any(word in one.coordinate for word in ("yaw", "turn"))
    scale, unit, digits = (180 / np.pi, " degrees", 0) if turned else (1.0, " m", 3)
    name, numbers = one.coordinate, (one.value, *one.usual)
    if "tilt" in name:  # sines of angles from the vertical
        numbers, scale, unit, digits = tuple(np.clip(numbers, -1, 1)), 1.0, "", 2
    value, low, high = (f"{scale * number:.{digits}f}" for number in numbers)
    return f"{_SAID.get(name, name)} is {value}{unit}, demonstrations have {low} to {high}{unit}"


_SAID = {"z": "height", "tilt z": "cosine of the tilt", "tilt x": "tilt along x", "tilt y": "tilt along y"}


def _faults(plan: Plan) -> Iterator[Finding]:
    """Yield the fault that explains all recordings of a plan better than what they say."""
    if len(plan.members) < 2:
        return
    for fault, gain in explained(plan.shown.taking(plan.shown.acts))[:1]:
        said = f"probably {fault.says} in all demonstrations (by {gain:.0f} nats of evidence): {fault.remedy}"
        if (one := finding(fault.code, float(np.exp(-gain)), said, "demonstrations")).danger:
            yield one


def _scripts(plans: Sequence[Plan], others: Sequence[Recording]) -> Iterator[Finding]:
    """Yield a doubt where recordings switch the gripper otherwise and nothing of the scene says when."""
    number = sum(len(plan.members) for plan in plans)
    if others:
        names = ", ".join(item.id for item in others)
        said = f"demonstrations {names} of {number} switch the gripper otherwise, and nothing of the scene says when"
        said = f"{said}: they are not used; leave them out, or record them anew"
        yield finding("several-ways", 1 - len(others) / number, said, "demonstrations")


def _events(plans: Sequence[Plan], recordings: Sequence[Recording]) -> Iterator[Finding]:
    """Yield a doubt where recorded events are not those that words ask for."""
    excused = {item.id: _excused(plan) for plan in plans for item in plan.members}
    least = np.log(LEVELS["unlike-words"].danger)
    said: Counter[str] = Counter()
    nats, inverted, gain = [], 0, 0.0
    for item in recordings:
        found = [fault for fault in script.faults(item) if fault.name not in excused.get(item.id, set())]
        nats.append(sum(fault.nats for fault in found))
        if nats[-1] <= least:
            said[" and ".join(fault.name for fault in found)] += 1
            turned = sum(fault.nats for fault in script.faults(item, inverted=True)) - nats[-1]
            inverted, gain = inverted + (turned > -least / 2), gain + turned
    turned_over = "the gripper is probably inverted in all demonstrations: send 1 where it is open"
    cause = finding("another-convention", float(np.exp(-gain)), turned_over, "demonstrations")
    if 2 * inverted > len(recordings) and cause.danger:
        yield cause
    elif total := sum(said.values()):
        what, _ = said.most_common(1)[0]
        message = f"{total} of {len(recordings)} demonstrations: the gripper or the hand {what}, unlike what words ask"
        p = float(np.exp(sorted(nats)[int(SHARE * len(nats))]))  # more than this share is as improbable
        yield finding("unlike-words", p, f"{message}: check the gripper, or record them anew", "demonstrations")


def _objects(plan: Plan) -> Iterator[Finding]:
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
        if (gap := _gap(plan, rows.switches[event], keys)) > OTHER_OBJECT * rows.number:
            yield _other(named[_best(row)], one.objects[0], gap)
    if not wanted and item.order.objects:
        acts = [plan.rows[k] for k in rows.acts]
        asked = [[role[folded_name(name)] for name in clause.objects] for clause in item.order.clauses]
        if (gap := _in_order(plan, [keys for keys in asked if keys])) > OTHER_OBJECT * rows.number:
            follows = list(dict.fromkeys(named[_best(row)] for row in acts))
            yield _other(" and then ".join(follows), " and then ".join(item.order.objects), gap)


def _in_order(plan: Plan, asked: Sequence[Sequence[str]]) -> float:
    """Return the nats by which acts rather follow other objects than those that clauses ask for, one after the other.

    Each clause has an act, in the order of words; of all ways the best one counts.
    """
    acts = plan.shown.acts
    if len(acts) < len(asked):
        return 0.0
    prices = np.zeros(len(acts) + 1)
    for keys in asked:
        gaps = [_gap(plan, k, keys) for k in acts]
        prices = np.minimum.accumulate([np.inf, *(prices[:-1] + gaps)])
    return float(prices[-1])


def _best(row: Row) -> str:
    """Return the key of the object that a row rather follows than any other."""
    return max(row.rivals, key=lambda key: row.rivals[key])


def _gap(plan: Plan, k: int, keys: Sequence[str]) -> float:
    """Return the nats by which row k rather follows another object, and is there, than the best of these.

    What turns with an object, or is a part of it, tells where to go from afar: the hand must be at it as well.
    """
    rows, follows = plan.shown, plan.rows[k].rivals
    own = [key for key in keys if key in follows]
    if not own:
        return -np.inf
    away = np.median(np.linalg.norm(rows.scenes.place - rows.hand[:, k, None], axis=2), axis=0).tolist()
    near = {key: script.log_t(off) for key, off in zip(rows.scenes.keys, away, strict=True)}
    followed, at = max(follows[key] for key in own), max(near[key] for key in own)
    return max(min(follows[key] - followed, rows.number * (near[key] - at)) for key in follows)


def _other(follows: str, named: str, gap: float) -> Finding:
    said = f"the hand follows {follows} where words say {named}: check the instruction and the objects' names"
    return finding("unlike-words", float(np.exp(-gap)), said, "demonstrations")


def _clock(plan: Plan) -> Iterator[Finding]:
    """Yield a doubt where the gripper's switches fit the motion better some time earlier or later."""
    pairs = [m for m in plan.members if any(e.opens for e in script.events(m)) or script.expected(m.order)]
    if 2 * len(pairs) <= len(plan.members):
        return
    now = np.array([script.fits(item, 0.0) for item in pairs])
    gains = [float(np.median([script.fits(item, s) for item in pairs] - now)) for s in SHIFTS_S]
    best = int(np.argmax(gains))
    if gains[best] > CLOCK:
        said = f"the gripper fits the motion better {SHIFTS_S[best]:+.1f} s later: send it by the clock of the poses"
        cause = finding("another-convention", float(np.exp(-gains[best] * len(pairs))), said, "demonstrations")
        if cause.danger:
            yield cause


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


def _acts(plan: Plan) -> Iterator[Finding]:
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
    if doubtful:
        yield _uncertain(plan, max(doubtful, key=lambda k: fails[k]), max(fails[k] for k in doubtful))
    if second.any() and gain > 0:
        said = f"demonstrations {', '.join(_ids(plan, second))} act in another way than the others"
        why = _why(plan, second) if doubtful else ""
        yield finding("several-ways", 1.0, f"{said} (by {gain:.0f} nats of evidence){why}", "demonstrations")


def _uncertain(plan: Plan, k: int, fails: float) -> Finding:
    row = plan.rows[k]
    of, off_m, off_deg = plan.followed_by(k), float(row.scale[:3].max()), float(np.degrees(row.scale[3:].max()))
    said = f"where the hand {_does(plan, k)}, row {k}, it scatters by {100 * off_m:.1f} cm and {off_deg:.0f} degrees"
    message = f"{said} as seen from {of}, and fails in {fails:.0%}: record what it follows, or more alike"
    return finding("uncertain-act", 1 - fails, message, "demonstrations", row=k, off_m=off_m, off_deg=off_deg)


def _does(plan: Plan, k: int) -> str:
    if k not in plan.shown.switches:
        return "acts"
    return "lets go" if plan.rows[k].gripper_open else "closes"


def _grips(plan: Plan) -> bool:
    """Return whether the gripper's switches are acts; a single one that words do not ask for closes a fist anywhere."""
    return len(plan.shown.switches) > 1 or bool(script.expected(plan.members[0].order))


def _why(plan: Plan, second: Which) -> str:
    """Return the fault that explains those recordings best."""
    best = explained(plan.shown.taking(plan.shown.acts), second)[:1]
    return "".join(f": probably {fault.says} there (by {gain:.0f} nats): {fault.remedy}" for fault, gain in best)


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


def _repeated(recordings: Sequence[Recording]) -> Iterator[Finding]:
    """Yield a doubt for each object that several recordings have in exactly one place, though it moves in others."""
    scenes = [item.scene.by_name() for item in recordings]
    for name in sorted(set.intersection(*(set(scene.names) for scene in scenes))):
        places = np.array([scene.place[scene.keys.index(name)] for scene in scenes])
        if np.ptp(places, axis=0).max() < EXACT:
            continue
        again = [np.abs(places[n] - places[:n]).max(axis=1).min() < EXACT for n in range(1, len(places))]
        if sum(again) > REPEATED * len(places):
            said = f"{name} is in {sum(again)} demonstrations exactly where another has it: check that poses are new"
            yield finding("measured-twice", 0.0, said, f"objects[{name}]")
