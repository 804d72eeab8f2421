"""Runs: robots that carry out a prediction now, and whether somebody stopped them; cases: predictions to ask again;
films: what cameras took during an episode; earlier settings of tasks.

Episodes have the id of the failed prediction that they correct, the key that uploaded them, what is kept of a trimmed
recording, and the findings. SQLite copies the table, so that these stand before the trajectory: it reads
all that stands before a column.

Columns go that nothing reads: the step of a prediction, and the status of an answer to a repeated request.
"""

import sqlalchemy as sa
from alembic import op

revision = "1.1.dev2"  # another with each change until 1.1 is released: folders of the one before are refused
down_revision = "1.0"
branch_labels = None
depends_on = None

UTC_DATE_TIME = sa.DateTime(timezone=True)
JSON = sa.JSON(none_as_null=True)
ADDED = {"corrects": sa.String(32), "key_id": sa.String(16), "trim": JSON, "findings": JSON}

INDEXED = ("corrects", "key_id")


def upgrade() -> None:
    op.create_table(
        "runs",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("key_id", sa.String(16)),
        sa.Column("state", JSON, nullable=False),
        sa.Column("stop", sa.Boolean(), nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("heard_at", UTC_DATE_TIME, nullable=False),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_runs_task_tasks"),
        sa.PrimaryKeyConstraint("id", name="pk_runs"),
    )
    op.create_table(
        "cases",
        sa.Column("prediction_id", sa.String(32), nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.ForeignKeyConstraint(["prediction_id"], ["predictions.id"], name="fk_cases_prediction_id_predictions"),
        sa.PrimaryKeyConstraint("prediction_id", name="pk_cases"),
    )
    op.create_table(
        "replaced_settings",
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("version", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("replaced_at", UTC_DATE_TIME, nullable=False),
        sa.Column("replaced_by", sa.String(96), nullable=False),
        sa.Column("settings", JSON, nullable=False),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_replaced_settings_task_tasks"),
        sa.PrimaryKeyConstraint("task", "version", name="pk_replaced_settings"),
    )
    copied = op.get_context().dialect.name == "sqlite"
    recreate, place = ("always", {"insert_before": "left_out"}) if copied else ("never", {})
    with op.batch_alter_table("episodes", recreate=recreate, table_kwargs={"sqlite_autoincrement": True}) as table:
        for name, kind in ADDED.items():
            table.add_column(sa.Column(name, kind), **place)
    for name in INDEXED:
        op.create_index(f"ix_episodes_{name}", "episodes", [name])
    op.create_table(
        "films",
        sa.Column("episode_id", sa.String(32), nullable=False),
        sa.Column("camera", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.ForeignKeyConstraint(["episode_id"], ["episodes.id"], name="fk_films_episode_id_episodes"),
        sa.PrimaryKeyConstraint("episode_id", "camera", name="pk_films"),
    )
    op.drop_column("predictions", "step")
    op.drop_column("idempotency_keys", "status")


def downgrade() -> None:
    op.add_column("idempotency_keys", sa.Column("status", sa.Integer(), nullable=False, server_default="200"))
    op.add_column("predictions", sa.Column("step", sa.Integer()))
    op.drop_table("films")
    for name in INDEXED:
        op.drop_index(f"ix_episodes_{name}", "episodes")
    for column in ADDED:
        op.drop_column("episodes", column)
    op.drop_table("replaced_settings")
    op.drop_table("cases")
    op.drop_table("runs")
