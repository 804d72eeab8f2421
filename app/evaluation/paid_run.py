"""A run whose LLM costs money: estimated and confirmed before the first trial, stopped by a budget."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from app.evaluation.costs import Prices, Purse, Usage
from app.evaluation.estimates import Kind, estimates, kind_of
from app.evaluation.results import Trial
from app.evaluation.run import Lessons, Run
from app.evaluation.teach import Lesson, suffix_of
from app.evaluation.trials import Cell, Laboratory

Confirm = Callable[[Mapping[Kind, Usage]], None]  # raises to refuse


@dataclass(frozen=True, eq=False)
class PaidRun(Run):
    """One session of a plan whose methods all name their model.

    Args:
        confirm: called with the estimate of one trial of each kind, once tasks are taught and before an LLM is asked.
        budget: for this session; None: unlimited.
    """

    confirm: Confirm = field(kw_only=True)
    prices: Prices = field(default_factory=dict)
    budget: float | None = None
    _kinds: dict[Kind, Usage] = field(default_factory=dict)

    @cached_property
    def purse(self) -> Purse:
        """What pays for the trials."""
        return Purse(self.budget, self.prices, lambda cell: self._kinds.get(kind_of(cell), Usage()).cost or 0.0)

    def run_trials(self, lessons: Mapping[str, Lessons]) -> None:
        """As `Run` does, once the estimate is confirmed.

        Raises:
            BudgetSpentError: before the trial that may exceed the budget; what is under way still ends.
            ServiceLostError; what `confirm` raises.
        """
        if remaining := self.plan.remaining(self.ledger):
            self._kinds.update(
                estimates(
                    self.client,
                    remaining,
                    lambda cell: self._lesson(lessons, cell),
                    self._laboratory().look,
                    self.prices,
                )
            )
            self.confirm(self._kinds)
        super().run_trials(lessons)

    def _lesson(self, lessons: Mapping[str, Lessons], cell: Cell) -> Lesson | Exception:
        return lessons[cell.task][suffix_of(cell.method, self.plan.methods)]

    def _run_cell(self, laboratory: Laboratory, cell: Cell, lesson: Lesson | Exception) -> None:
        self.purse.put_aside(cell)
        try:
            super()._run_cell(laboratory, cell, lesson)
        finally:
            outcome = self.plan.outcome(self.ledger, cell)
            self.purse.pay(cell, outcome if isinstance(outcome, Trial) else None)
