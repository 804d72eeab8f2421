"""Which roboprompt-client the wheel of roboprompt requires; hatchling runs this while it builds."""

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

CLIENT = "roboprompt-client"


class ClientRequirement(BuildHookInterface):  # type: ignore[type-arg, unused-ignore]
    """Requires the client of the same version; `pip install .` takes it from the folder beside it.

    No registry has the client, so that pip finds it nowhere else. Wheels that leave this machine must not name a folder
    of it: `make dist` and the container image are built by hatchling itself, without pip.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Complete the requirement of pyproject.toml."""
        by_pip = "PIP_BUILD_TRACKER" in os.environ  # as hatchling itself tells who builds
        where = f" @ {(Path(self.root) / 'client').as_uri()}" if by_pip else f"=={self.metadata.version}"
        requirements = self.metadata.core.dependencies  # not added: pip gives up at the first that it finds nowhere
        requirements[requirements.index(CLIENT)] = CLIENT + where
