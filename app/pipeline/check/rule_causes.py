"""Whether the keyframes suit the recordings."""

from collections.abc import Sequence

import numpy as np

from app.pipeline.check.report import EpisodeCheck, PlanCheck
from app.pipeline.findings import Finding
from app.pipeline.keyframes import KeyframeRule
from app.pipeline.reply import MAX_ACTIONS

LEFT_M = 0.03  # farther than this from the recorded path a hand may hit what the demonstration went around
OFTEN = 1 / 3  # of the recordings without rests
MANY_ROWS = 20
RULES_OF_RESTS = ("merged", "authors")


def missed_path(plans: Sequence[PlanCheck], rule: KeyframeRule) -> list[Finding]:
    """A rule that looks for rests, in recordings that have none where the hand turns."""
    moving = _moving([episode for plan in plans for episode in plan.episodes])
    if rule.rule not in RULES_OF_RESTS or 2 * len(moving) <= sum(len(plan.episodes) for plan in plans):
        return []
    left_m = float(np.median([episode.path_m for episode in moving]))
    if left_m <= LEFT_M:
        return []
    rows = int(np.median([len(plan.rows) for plan in plans for _ in plan.episodes]))
    message = (
        f"The rule {rule.rule!r} looks for rests, and {len(moving)} recordings do not rest where the hand turns: it"
        f" finds {rows} keyframes, and the way between them is up to {100 * left_m:.1f} cm from the recorded one. Set"
        " keyframes.rule to `auto` or `waypoints`."
    )
    numbers = {"path_cm": round(100 * left_m, 2), "recordings": len(moving), "keyframes": rows}
    return [Finding("keyframes-miss-the-path", "danger", message, "keyframes.rule", numbers)]


def path_left(plan: PlanCheck, number: int, rule: KeyframeRule) -> list[Finding]:
    """Keyframes between which the recorded hand did not go straight."""
    moving = _moving(plan.episodes)
    left = [episode for episode in moving if episode.path_m > LEFT_M]
    if not plan.shown or len(left) <= OFTEN * len(moving):
        return []
    worst = max(left, key=lambda episode: episode.path_m)
    remedy = (
        f"lower keyframes.tolerance_m (it is {rule.tolerance_m:g})" if rule.aligned else "take the rule `waypoints`"
    )
    message = (
        f"In {len(left)} of {len(moving)} recordings that do not rest the way between keyframes leaves the recorded one"
        f" by more than {100 * LEFT_M:.0f} cm, in {worst.id} by {100 * worst.path_m:.1f} cm: {remedy}."
    )
    numbers = {"path_cm": round(100 * worst.path_m, 2), "recordings": len(left)}
    return [Finding("path-not-kept", "warning", message, f"plans[{number}]", numbers)]


def many_rows(plan: PlanCheck, number: int) -> list[Finding]:
    """A plan that is long for a language model, and near to what a reply may have."""
    if not plan.shown or len(plan.rows) <= MANY_ROWS:
        return []
    message = (
        f"{plan.episodes[0].instruction!r} takes {len(plan.rows)} rows; a reply may have {MAX_ACTIONS}, and the longer"
        " it is the more goes wrong: demonstrate the parts as tasks of their own, or raise keyframes.tolerance_m."
    )
    return [Finding("many-rows", "warning", message, f"plans[{number}]", {"rows": len(plan.rows)})]


def mixed_recordings(plan: PlanCheck, number: int) -> list[Finding]:
    """Recordings of one plan, some of which rest at their keyframes."""
    moving = len(_moving(plan.episodes))
    resting = len(plan.episodes) - moving
    if not (moving and resting):
        return []
    message = (
        f"{resting} recordings of {plan.episodes[0].instruction!r} rest at their keyframes and {moving} do not: their"
        " rows lie closer together if all are recorded in one manner."
    )
    return [Finding("mixed-recordings", "info", message, f"plans[{number}]", {"resting": resting, "moving": moving})]


def _moving(episodes: Sequence[EpisodeCheck]) -> list[EpisodeCheck]:
    return [episode for episode in episodes if episode.manner != "rests"]
