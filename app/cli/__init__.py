"""`roboprompt`: the service, its keys and backups; evaluation; data in and out; cameras."""

import sys
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from roboprompt_client.version import VERSION

# Each command: where it is, in this package, and its line in the list, for which no module is imported.
COMMANDS = {
    "serve": ("serve:serve", "Run the service until Ctrl-C."),
    "doctor": ("doctor:doctor", "Check what RoboPrompt needs on this machine."),
    "backup": ("administration:back_up", "Write the data folder to a tar file; the service may keep running."),
    "demo": ("demo:demo", "Teach a simulated Panda, then predict and execute on unseen scenes."),
    "eval": (
        "evaluate:evaluate",
        "Teach tasks, test methods on unseen scenes, and compare with the paper's numbers.",
    ),
    "check": ("check:check", "Predict each of a task's demonstrations from the others, and say what would go wrong."),
    "calibration-board": ("board:calibration_board", "Write the picture of a ChArUco board, to be printed."),
    "import": ("import_data:import_data", "Import a dataset; the same command again continues where it stopped."),
    "export": ("export_data:export_data", "Export a task: --archive, --lerobot."),
    "keys": ("administration:keys", "API keys: add, list, revoke."),
}


class _Commands(TyperGroup):
    """Imports a command's module when it is called."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401
        if args[0] in COMMANDS:
            self.add_command(load(args[0]))
        return super().resolve_command(ctx, args)


def load(name: str) -> Any:  # noqa: ANN401
    """The command or group of that name."""
    module, _, attribute = COMMANDS[name][0].partition(":")
    found = getattr(import_module(f"app.cli.{module}"), attribute)
    alone = typer.Typer()
    if isinstance(found, typer.Typer):
        alone.add_typer(found, name=name)
    else:
        alone.command(name)(found)
    return typer.main.get_group(alone).commands[name]


def _listed() -> None:
    """Placeholder in the list for a command that is not imported."""


application = typer.Typer(
    cls=_Commands, no_args_is_help=True, add_completion=False, help=__doc__, pretty_exceptions_enable=False
)
for _name, (_, _line) in COMMANDS.items():
    application.command(_name, help=_line)(_listed)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"roboprompt {VERSION}")
        raise typer.Exit


@application.callback()
def _options(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and end")
    ] = False,
) -> None:
    """Options of the program itself."""


def main() -> None:
    """Run the command line; where a package of an extra is missing, it says which extra to install."""
    try:
        application()
    except ModuleNotFoundError as error:
        from app.cli.shared import extra_with

        if (extra := extra_with(error.name or "")) is None:
            raise
        sys.exit(f"this needs {error.name}: pip install 'roboprompt[{extra}]'")
