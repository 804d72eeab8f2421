"""`roboprompt-robot doctor`: whether the robot's computer has what it needs; nothing moves."""

from argparse import Namespace
from collections.abc import Iterator
from importlib.util import find_spec

from roboprompt_client.arm_check import ArmCheck, CheckResult
from roboprompt_client.arms.cell import open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.look_command import AddCommand
from roboprompt_client.record_command import print_results
from roboprompt_client.version import VERSION

# The modules that each extra of roboprompt-client brings.
EXTRAS = {
    "images": ("cv2", "msgpack"),
    "franka": ("franky",),
    "ur": ("rtde_control",),
    "xarm": ("xarm",),
    "lerobot": ("lerobot",),
    "urdf": ("pinocchio",),
}


def add_doctor(add: AddCommand, robot_help: str) -> None:
    """Add `doctor` to the script's commands."""
    doctor = add("doctor", "say what is missing or wrong: service, packages, and the arm if named", run_doctor)
    doctor.add_argument("--robot", metavar="ROBOT", help=robot_help)


def run_doctor(client: RoboPromptClient, arguments: Namespace) -> int:
    """Print what was found; 1 where the service or the named arm fails."""
    results = [*look_at_service(client), *map(look_at_extra, EXTRAS)]
    if arguments.robot is not None:
        results += look_at_arm(arguments.robot)
    return print_results(results)


def look_at_service(client: RoboPromptClient) -> Iterator[CheckResult]:
    """Whether it answers, takes the key, and has this version."""
    try:
        client.ping()
    except RoboPromptError as error:
        yield CheckResult("service", False, f"{error}: roboprompt serve, or name another address by --url")
        return
    yield CheckResult("service", True, f"answers at {client.url}")
    try:
        version = client.get("/openapi.json")["info"]["version"]
    except RoboPromptError as error:
        yield CheckResult("key", None, f"may not read ({error}): ROBOPROMPT_API_KEY, roboprompt keys add --scope read")
        return
    same = True if version == VERSION else None
    remedy = "" if same else ": install the client of the service's version"
    yield CheckResult("version", same, f"service {version}, this client {VERSION}{remedy}")


def look_at_extra(extra: str) -> CheckResult:
    """Whether the modules of an extra are installed."""
    lacking = [module for module in EXTRAS[extra] if find_spec(module) is None]
    remedy = f"{', '.join(lacking)} not installed; if you need it: pip install 'roboprompt-client[{extra}]'"
    return CheckResult(f"extra {extra}", None if lacking else True, remedy if lacking else "installed")


def look_at_arm(name: str) -> list[CheckResult]:
    """What `roboprompt-robot check` sees without moving."""
    try:
        return list(ArmCheck(open_robot(name)).run())
    except RoboPromptError as error:
        return [CheckResult("arm", False, str(error))]
