"""`roboprompt`: the service, its keys, models and backups; evaluation; data in and out; cameras."""

import sys
from typing import Annotated

import typer

from app.cli import (
    audit,
    backup,
    calibrate,
    cases,
    check,
    demo,
    doctor,
    evaluate,
    export_data,
    import_data,
    jobs,
    keys,
    models,
    record,
    serve,
)
from app.cli.extras import extra_with
from roboprompt_client.version import VERSION

application = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__, pretty_exceptions_enable=False)
application.command("serve")(serve.serve)
application.command("doctor")(doctor.doctor)
application.add_typer(keys.application, name="keys")
application.add_typer(models.application, name="models")
application.command("audit")(audit.audit)
application.command("backup")(backup.back_up)
application.command("restore")(backup.restore)
application.command("jobs")(jobs.jobs)
application.command("demo")(demo.demo)
application.command("record")(record.record)
application.command("eval")(evaluate.evaluate)
application.command("films")(demo.films)
application.command("film")(demo.film)
application.command("teach-objects")(calibrate.teach_objects)
application.command("check")(check.check)
application.add_typer(cases.application, name="cases")
application.command("calibrate")(calibrate.calibrate)
application.command("calibration-board")(calibrate.calibration_board)
application.command("import")(import_data.import_data)
application.command("export")(export_data.export_data)


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
        if (extra := extra_with(error.name or "")) is None:
            raise
        sys.exit(f"this needs {error.name}: pip install 'roboprompt[{extra}]'")
