"""`roboprompt`: the service, its keys and backups; evaluation; data in and out; cameras."""

import typer

from app.cli import (
    audit,
    backup,
    calibrate,
    check,
    demo,
    evaluate,
    export_data,
    films,
    import_data,
    jobs,
    keys,
    serve,
    teach_objects,
)

application = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__, pretty_exceptions_enable=False)
application.command("serve")(serve.serve)
application.add_typer(keys.application, name="keys")
application.command("audit")(audit.audit)
application.command("backup")(backup.back_up)
application.command("restore")(backup.restore)
application.command("jobs")(jobs.jobs)
application.command("demo")(demo.demo)
application.command("eval")(evaluate.evaluate)
application.command("films")(films.films)
application.command("teach-objects")(teach_objects.teach_objects)
application.command("check")(check.check)
application.command("calibrate")(calibrate.calibrate)
application.command("calibration-board")(calibrate.calibration_board)
application.command("import")(import_data.import_data)
application.command("export")(export_data.export_data)


def main() -> None:
    """Run the command line."""
    application()
