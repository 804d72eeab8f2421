"""How near a driver brought the arm to the poses that it was asked for."""

from dataclasses import dataclass
from statistics import median

from app.evaluation.results import Evaluation


@dataclass(frozen=True)
class Reached:
    """Over all actions that a driver carried out."""

    poses: int
    median_mm: float
    worst_mm: float
    median_deg: float
    worst_deg: float

    def __str__(self) -> str:
        position = f"{self.median_mm:.2g} mm in the median, {self.worst_mm:.2g} mm at worst"
        rotation = f"{self.median_deg:.2g} and {self.worst_deg:.2g} degrees"
        return f"{self.poses} poses reached: off by {position} ({rotation})"


def reached(evaluation: Evaluation) -> Reached | None:
    """None where the simulation itself moved the arm."""
    executions = [trial.execution for task in evaluation.tasks for trial in task.trials]
    misses = [miss for execution in executions if execution is not None for miss in execution.misses]
    if not misses:
        return None
    off_mm, off_deg = [1000 * off_m for off_m, _ in misses], [turned_deg for _, turned_deg in misses]
    return Reached(len(misses), median(off_mm), max(off_mm), median(off_deg), max(off_deg))
