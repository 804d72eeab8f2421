"""Why rows cannot be predicted: they follow nothing that is known, or what they follow is not known well."""

from collections import defaultdict
from collections.abc import Sequence

from app.pipeline.check.report import PlanCheck, RowCheck
from app.pipeline.findings import Finding
from app.pipeline.keyframes import KeyframeRule

FEWEST = 3  # demonstrations of a plan, from which on its rows are judged
UNEXPLAINED_M = 0.06  # rotation included
UNEXPLAINED_DEG = 40.0
UNEXPLAINED = 0.8  # the share of a row's variation that remains where it follows nothing that is known
NOISY_M = 0.02


def row_cause(plan: PlanCheck, number: int, rule: KeyframeRule) -> Finding | None:
    """What is wrong with the rows of a plan: one object that is missing spoils some, noise all that follow an object.

    Args:
        number: of the plan.
    """
    if len(plan.episodes) < FEWEST:
        return None
    unexplained = _unexplained(plan, rule)
    explained = [row for k, row in enumerate(plan.rows) if k not in unexplained]
    noisy = {name: row for name, row in _closest(explained).items() if row.error is not None and row.error.m >= NOISY_M}
    if noisy and len(explained) > len(unexplained):
        return _noisy_poses(noisy, number)
    return _follows_no_object(plan, unexplained, number) if unexplained else None


def _unexplained(plan: PlanCheck, rule: KeyframeRule) -> Sequence[int]:
    """Rows that follow nothing that is known, though their place matters.

    People come from anywhere, leave to anywhere, and close an empty hand on the way: without rests it matters where the
    gripper switches if the next row follows nothing either, and where the last row is if the gripper never switches.
    """
    lost = [k for k, row in enumerate(plan.rows) if _follows_nothing(row)]
    if rule.rule not in ("waypoints", "uniform") and all(episode.manner == "rests" for episode in plan.episodes):
        return lost
    last = len(plan.rows) - 1
    switches = [k for k, row in enumerate(plan.rows) if row.switches] or [last]
    return [k for k in lost if k in switches and (k == last or k + 1 in lost)]


def _follows_nothing(row: RowCheck) -> bool:
    if row.error is None:
        return False
    lost = min(row.error.together_m, row.varies.together_m) >= UNEXPLAINED_M
    turned = min(row.error.deg, row.varies.deg) >= UNEXPLAINED_DEG
    return (lost and row.error.together_m >= UNEXPLAINED * row.varies.together_m) or (
        turned and row.error.deg >= UNEXPLAINED * row.varies.deg
    )


def _closest(rows: Sequence[RowCheck]) -> dict[str, RowCheck]:
    """By object the row that keeps closest to it."""
    following: dict[str, list[RowCheck]] = defaultdict(list)
    for row in rows:
        if row.objects and row.error is not None:
            following[", ".join(row.objects)].append(row)
    return {name: min(found, key=_error_m) for name, found in following.items()}


def _error_m(row: RowCheck) -> float:
    return 0.0 if row.error is None else row.error.m


def _together_m(row: RowCheck) -> float:
    return 0.0 if row.error is None else row.error.together_m


def _noisy_poses(noisy: dict[str, RowCheck], number: int) -> Finding:
    name = max(noisy, key=lambda name: _error_m(noisy[name]))
    error = noisy[name].error
    assert error is not None
    message = (
        f"Even where the hand keeps closest to {name} it scatters by {100 * error.m:.1f} cm and {error.deg:.0f} degrees"
        " around it. The objects' poses are that noisy, or the hand goes there that loosely: check calibration and"
        " estimator, and record more demonstrations, whose mean is shown."
    )
    numbers = {"scatter_cm": round(100 * error.m, 2), "scatter_deg": round(error.deg, 1)}
    return Finding("noisy-poses", "warning", message, f"plans[{number}]", numbers)


def _follows_no_object(plan: PlanCheck, places: Sequence[int], number: int) -> Finding:
    worst = max((plan.rows[k] for k in places), key=_together_m)
    assert worst.error is not None
    known = ", ".join(dict.fromkeys(name for row in plan.rows for name in row.objects)) or "none"
    which = f"Row {places[0] + 1}" if len(places) == 1 else f"Rows {', '.join(str(k + 1) for k in places)}"
    message = (
        f"{which} of {plan.episodes[0].instruction!r} vary by {100 * worst.varies.m:.1f} cm and"
        f" {worst.varies.deg:.0f} degrees and follow no known object: {100 * worst.error.m:.1f} cm and"
        f" {worst.error.deg:.0f} degrees off where the others predict them. Is an object missing that decides where the"
        f" hand goes? Other rows follow: {known}."
    )
    error_cm, varies_cm = round(100 * worst.error.m, 2), round(100 * worst.varies.m, 2)
    numbers = {"error_cm": error_cm, "varies_cm": varies_cm, "rows": len(places)}
    return Finding("row-follows-no-object", "danger", message, f"plans[{number}].rows[{places[0]}]", numbers)
