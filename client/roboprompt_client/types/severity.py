"""How severe a finding is: `info` explains, `warning` doubts the result, and on a `danger` a robot stops."""

from typing import Literal

Severity = Literal["info", "warning", "danger"]
SEVERITIES: tuple[Severity, ...] = ("info", "warning", "danger")  # the lowest first
