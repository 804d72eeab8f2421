"""Who decides where the service finds its own answer dangerous."""

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, get_args

from roboprompt_client.errors import DangerError, InvalidInputError, NotConfirmedError
from roboprompt_client.trajectory import EndEffectorAction

Confirm = Callable[[int, EndEffectorAction], bool]
OnDanger = Literal["confirm", "refuse", "go"]
log = logging.getLogger(__name__)


def what_to_do(on_danger: OnDanger | None, confirm: Confirm | None) -> OnDanger:
    """The setting, where None asks whoever there is to ask and refuses otherwise.

    Raises:
        InvalidInputError: if it is none, or nobody can be asked.
    """
    if on_danger is None:
        return "refuse" if confirm is None else "confirm"
    if on_danger not in get_args(OnDanger):
        raise InvalidInputError("on_danger", f"is {on_danger!r:.40}", ", ".join(get_args(OnDanger)))
    if on_danger == "confirm" and confirm is None:
        raise InvalidInputError("on_danger", "is 'confirm', but there is no `confirm` to ask", "refuse, go")
    return on_danger


def heed(
    findings: Sequence[Mapping[str, Any]],
    actions: Sequence[EndEffectorAction],
    *,
    on_danger: OnDanger,
    confirm: Confirm | None,
) -> None:
    """Let a prediction pass that nothing speaks against, or that somebody answers for.

    Every danger is logged as a warning; `confirm` is asked once for each, with the action that it is about, else with
    the first.

    Raises:
        DangerError: if it is refused.
        NotConfirmedError: if `confirm` said no.
    """
    dangers = [finding for finding in findings if finding.get("severity") == "danger"]
    for finding in dangers if actions else ():
        message = str(finding.get("message", finding.get("code", "")))
        log.warning("danger: %s", message)
        if on_danger == "refuse":
            raise DangerError(f"the prediction is dangerous: {message}")
        index = _action_of(finding, len(actions))
        if on_danger == "confirm" and confirm is not None and not confirm(index, actions[index]):
            raise NotConfirmedError(f"action {index + 1} was not allowed: {message}")


def _action_of(finding: Mapping[str, Any], num_actions: int) -> int:
    """The index of the action that a finding is about; 0 where it is about the scene."""
    named = re.fullmatch(r"actions\[(\d+)\].*", str(finding.get("where", "")))
    return min(int(named[1]), num_actions - 1) if named else 0
