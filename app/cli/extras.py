"""The extras of the distribution, as its metadata say."""

import re
from collections import defaultdict
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution, requires

REQUIREMENT = re.compile(r"([\w.-]+)[^;]*;.*extra == ['\"]([\w-]+)['\"]")


def packages_of_extras() -> Mapping[str, list[str]]:
    """The packages that each extra installs; empty where RoboPrompt runs from a folder, without being installed."""
    found: dict[str, list[str]] = defaultdict(list)
    try:
        lines = requires("roboprompt") or []
    except PackageNotFoundError:
        return found
    for package, extra in (match.groups() for line in lines if (match := REQUIREMENT.match(line))):
        found[extra].append(package)
    return found


def is_installed(package: str) -> bool:
    """Whether a distribution of this name is installed."""
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


def extra_with(module: str) -> str | None:
    """The extra that brings a module; None if none does."""
    package = module.partition(".")[0].replace("_", "-")
    return next((extra for extra, packages in packages_of_extras().items() if package in packages), None)
