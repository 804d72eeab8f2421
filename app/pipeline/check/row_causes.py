"""Why rows cannot be predicted: they follow nothing that is known, or what they follow is not known well."""

from collections import defaultdict
from collections.abc import Sequence

from app.pipeline.check.report import PlanCheck, RowCheck
from app.pipeline.findings import Finding

FEWEST = 3  # demonstrations of a plan, from which on its rows are judged
UNEXPLAINED_M = 0.06  # rotation included
UNEXPLAINED = 0.8  # the share of a row's variation that remains where it follows nothing that is known
NOISY_M = 0.02


def row_cause(plan: PlanCheck, number: int) -> Finding | None:
    """What is wrong with the rows of a plan: one object that is missing spoils some, noise all that follow an object.

    Args:
        number: of the plan.
    """
    if len(plan.episodes) < FEWEST:
        return None
    unexplained = [k for k in _judged(plan) if _follows_nothing(plan.rows[k])]
    explained = [row for k, row in enumerate(plan.rows) if k not in unexplained]
    noisy = {name: row for name, row in _closest(explained).items() if row.error is not None and row.error.m >= NOISY_M}
    if noisy and len(explained) > len(unexplained):
        return _noisy_poses(noisy, number)
    return _follows_no_object(plan, unexplained, number) if unexplained else None


def _judged(plan: PlanCheck) -> Sequence[int]:
    """The rows whose place matters: people come from anywhere, and leave to anywhere."""
    everything = range(len(plan.rows))
    if all(episode.manner == "rests" for episode in plan.episodes):
        return everything
    return [k for k in everything if plan.rows[k].switches] or everything[-1:]


def _follows_nothing(row: RowCheck) -> bool:
    if row.error is None or min(row.error.together_m, row.varies.together_m) < UNEXPLAINED_M:
        return False
    return row.error.together_m >= UNEXPLAINED * row.varies.together_m


def _closest(rows: Sequence[RowCheck]) -> dict[str, RowCheck]:
    """By object the row that keeps closest to it."""
    following: dict[str, list[RowCheck]] = defaultdict(list)
    for row in rows:
        if row.objects and row.error is not None:
            following[", ".join(row.objects)].append(row)
    return {name: min(found, key=_error_m) for name, found in following.items()}


def _error_m(row: RowCheck) -> float:
    return 0.0 if row.error is None else row.error.m


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
    worst = max((plan.rows[k] for k in places), key=_error_m)
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
