"""Outcomes as Markdown tables, silent failures first."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.adversary.kinds import KINDS
from benchmarks.adversary.measure import Outcome

HEAD = (
    "| kind | cases | refused at upload | refused | danger | solved | **failed silently** | rate |\n"
    "|---|---|---|---|---|---|---|---|"
)
STOPPED = ("refused at upload", "refused", "danger")


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The two rates and what they are made of."""
    wrong = [item for item in outcomes if item.wrong]
    right = [item for item in outcomes if not item.wrong]
    contradictory = [item for item in wrong if KINDS[item.kind].contradictory]
    detectable = [item for item in wrong if not item.undetectable]
    silent, alarms = _ending(wrong, "silent"), _stopped(right)
    return {
        "wrong": len(wrong),
        "silent_failures": silent,
        "silent_failure_rate": _rate(silent, len(wrong)),
        "contradictory": len(contradictory),
        "contradictory_silent_failures": _ending(contradictory, "silent"),
        "contradictory_silent_failure_rate": _rate(_ending(contradictory, "silent"), len(contradictory)),
        "detectable": len(detectable),
        "detectable_silent_failures": _ending(detectable, "silent"),
        "detectable_silent_failure_rate": _rate(_ending(detectable, "silent"), len(detectable)),
        "right": len(right),
        "false_alarms": alarms,
        "false_alarm_rate": _rate(alarms, len(right)),
        "right_failed_silently": _ending(right, "silent"),
    }


def tables(outcomes: Sequence[Outcome], command: str) -> str:
    """Kinds of wrong cases, silent failures one by one, kinds of right cases, findings."""
    wrong = [item for item in outcomes if item.wrong]
    right = [item for item in outcomes if not item.wrong]
    silent = [item for item in wrong if item.ending == "silent"]
    parts = [
        _by_evidence(wrong),
        _by_kind(wrong),
        _by_kind(right),
        _by_code(outcomes),
        _by_upload_code(outcomes),
        _one_by_one(silent, command),
    ]
    return "\n\n".join(parts)


def shown(outcome: Outcome, answer: Mapping[str, Any]) -> str:
    """One case for people: what became of it, every finding, how the words were understood, and the actions."""
    lines = [f"{outcome.kind}, {outcome.task} {outcome.seed}: {outcome.ending.upper()}. {outcome.failure}"]
    lines += [f"  of an upload: {code} ({severity})" for code, severity in outcome.upload_findings]
    lines += [f"  {item['severity']} {item['code']}: {item['message']}" for item in answer.get("findings", ())]
    lines += [f"  {item['phrase']!r} is {item['object']!r} by {item['by']}" for item in answer.get("grounding", ())]
    for k, action in enumerate(answer.get("actions", ())):
        place = ", ".join(f"{x:.3f}" for x in action["position"])
        anchor = action.get("anchor") or {}
        fingers = "open" if action["gripper_open"] else "closed"
        lines.append(
            f"  action {k + 1}: ({place}) m, {fingers}, seen from {anchor.get('object') or anchor.get('frame')}"
        )
    return "\n".join(lines) + "\n"


def _by_kind(outcomes: Sequence[Outcome]) -> str:
    groups = [[o for o in outcomes if o.kind == kind] for kind in dict.fromkeys(o.kind for o in outcomes)]
    lines = [HEAD]
    groups.sort(key=lambda group: -_ending(group, "silent") / len(group))
    lines += [_line(f"{g[0].kind}{'' if KINDS[g[0].kind].contradictory else ' *'}", g) for g in groups]
    return "\n".join([*lines, _line("**all**", outcomes)])


def _by_evidence(wrong: Sequence[Outcome]) -> str:
    """Whether anything that was sent could tell the case from a right one."""
    groups = {
        "recordings, words or scene differ from a right case": [item for item in wrong if not item.undetectable],
        "undetectable by construction": [item for item in wrong if item.undetectable],
    }
    return "\n".join([HEAD, *(_line(name, group) for name, group in groups.items())])


def _line(name: str, group: Sequence[Outcome]) -> str:
    numbers = [_ending(group, ending) for ending in (*STOPPED, "solved", "silent")]
    cells = [name, len(group), *numbers, f"{100 * _rate(numbers[-1], len(group)):.0f} %"]
    return f"| {' | '.join(map(str, cells))} |"


def _by_code(outcomes: Sequence[Outcome]) -> str:
    """Return how many wrong and right cases each finding has."""
    found = {
        "wrong, fails": Counter(kind for o in outcomes if o.wrong and not o.succeeded for kind in o.findings),
        "wrong, solved": Counter(kind for o in outcomes if o.wrong and o.succeeded for kind in o.findings),
        "right": Counter(kind for o in outcomes if not o.wrong for kind in o.findings),
    }
    kinds = sorted(
        {kind for counter in found.values() for kind in counter}, key=lambda kind: -found["wrong, fails"][kind]
    )
    lines = ["| finding of the answer | severity | wrong, fails | wrong, solved | right |", "|---|---|---|---|---|"]
    for kind in kinds:
        lines.append(f"| `{kind[0]}` | {kind[1]} | " + " | ".join(str(c[kind]) for c in found.values()) + " |")
    return "\n".join(lines)


def _by_upload_code(outcomes: Sequence[Outcome]) -> str:
    wrong = Counter(kind for o in outcomes if o.wrong for kind in o.upload_findings)
    right = Counter(kind for o in outcomes if not o.wrong for kind in o.upload_findings)
    lines = ["| finding of an upload | severity | wrong | right |", "|---|---|---|---|"]
    lines += [
        f"| `{k[0]}` | {k[1]} | {wrong[k]} | {right[k]} |" for k in sorted({*wrong, *right}, key=lambda k: -wrong[k])
    ]
    return "\n".join(lines)


def _one_by_one(silent: Sequence[Outcome], command: str) -> str:
    lines = [f"Each again: `{command} --kind KIND --task TASK --seed SEED --show`.", ""]
    lines += ["| failed silently | task | seed | findings | what happened |", "|---|---|---|---|---|"]
    for o in sorted(silent, key=lambda o: (o.kind, o.task, o.seed)):
        found = ", ".join(f"{code} ({severity})" for code, severity in o.findings)
        lines.append(f"| {o.kind} | {o.task} | {o.seed} | {found} | {o.failure} |")
    return "\n".join(lines)


def _ending(outcomes: Sequence[Outcome], ending: str) -> int:
    return sum(item.ending == ending for item in outcomes)


def _stopped(outcomes: Sequence[Outcome]) -> int:
    return sum(item.ending in STOPPED for item in outcomes)


def _rate(part: int, whole: int) -> float:
    return round(part / whole, 4) if whole else 0.0
