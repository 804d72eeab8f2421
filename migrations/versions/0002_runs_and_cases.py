"""Runs: robots that carry out a prediction now, and whether somebody stopped them; cases: predictions to ask again;
films: what cameras took during an episode.

Episodes that correct a failed prediction have its id.

Columns go that nothing reads: the step of a prediction, and the status of an answer to a repeated request.
"""

import sqlalchemy as sa
from alembic import op

revision = "1.1"
down_revision = "1.0"
branch_labels = None
depends_on = None

UTC_DATE_TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "runs",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("key_id", sa.String(16)),
        sa.Column("state", sa.JSON(none_as_null=True), nullable=False),
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
        "films",
        sa.Column("episode_id", sa.String(32), nullable=False),
        sa.Column("camera", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.ForeignKeyConstraint(["episode_id"], ["episodes.id"], name="fk_films_episode_id_episodes"),
        sa.PrimaryKeyConstraint("episode_id", "camera", name="pk_films"),
    )
    op.add_column("episodes", sa.Column("corrects", sa.String(32)))
    op.create_index("ix_episodes_corrects", "episodes", ["corrects"])
    op.drop_column("predictions", "step")
    op.drop_column("idempotency_keys", "status")


def downgrade() -> None:
    op.add_column("idempotency_keys", sa.Column("status", sa.Integer(), nullable=False, server_default="200"))
    op.add_column("predictions", sa.Column("step", sa.Integer()))
    op.drop_table("films")
    op.drop_index("ix_episodes_corrects", "episodes")
    op.drop_column("episodes", "corrects")
    op.drop_table("cases")
    op.drop_table("runs")
