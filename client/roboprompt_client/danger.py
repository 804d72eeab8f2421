"""What happens where the service finds its own prediction dangerous."""

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, get_args

from roboprompt_client.errors import DangerError, InvalidInputError, NotConfirmedError
from roboprompt_client.trajectory import EndEffectorAction

Confirm = Callable[[int, EndEffectorAction], bool]
OnDanger = Literal["confirm", "refuse", "go"]
log = logging.getLogger(__name__)


def checked_on_danger(on_danger: OnDanger | None, confirm: Confirm | None) -> OnDanger:
    """The setting; None becomes `confirm` where a person can be asked, else `refuse`.

    Raises:
        InvalidInputError: if there is no such setting, or no `confirm` to ask.
    """
    if on_danger is None:
        return "refuse" if confirm is None else "confirm"
    if on_danger not in get_args(OnDanger):
        raise InvalidInputError("on_danger", f"is {on_danger!r:.40}", ", ".join(get_args(OnDanger)))
    if on_danger == "confirm" and confirm is None:
        raise InvalidInputError("on_danger", "is 'confirm', but there is no `confirm` to ask", "refuse, go")
    return on_danger


def require_allowed(
    findings: Sequence[Mapping[str, Any]],
    actions: Sequence[EndEffectorAction],
    *,
    on_danger: OnDanger,
    confirm: Confirm | None,
) -> None:
    """Let a prediction pass that has no danger among its findings, or whose dangers a person allows.

    Every danger is logged as a warning; `confirm` is asked once for each, with the action that it is about, else with
    the first.

    Args:
        findings: well-formed, as `findings_in` returns them.

    Raises:
        DangerError: if `on_danger` refuses it.
        NotConfirmedError: if `confirm` said no.
    """
    dangers = [finding for finding in findings if finding["severity"] == "danger"]
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
