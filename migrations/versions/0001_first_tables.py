"""First tables."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

JSON = sa.JSON(none_as_null=True)
UTC_DATE_TIME = sa.DateTime(timezone=True)
SEQUENCE_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "tasks",
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("settings", JSON, nullable=False),
        sa.Column("object_names", JSON),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("updated_at", UTC_DATE_TIME, nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_tasks"),
    )
    op.create_table(
        "episodes",
        sa.Column("sequence", SEQUENCE_NUMBER, nullable=False),
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("instruction", sa.String(500), nullable=False),
        sa.Column("num_frames", sa.Integer(), nullable=False),
        sa.Column("control_frequency_hz", sa.Float(), nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("objects", JSON, nullable=False),
        sa.Column("keyframes", JSON, nullable=False),
        sa.Column("cameras", JSON, nullable=False),
        sa.Column("given_objects", JSON, nullable=False),
        sa.Column("extra", JSON, nullable=False),
        sa.Column("trajectory", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_episodes_task_tasks"),
        sa.PrimaryKeyConstraint("sequence", name="pk_episodes"),
        sa.UniqueConstraint("id", name="uq_episodes_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_episodes_task_sequence", "episodes", ["task", "sequence"])
    op.create_index("ix_episodes_task_instruction_sequence", "episodes", ["task", "instruction", "sequence"])
    op.create_table(
        "predictions",
        sa.Column("sequence", SEQUENCE_NUMBER, nullable=False),
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("instruction", sa.String(500), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("representation", sa.String(), nullable=False),
        sa.Column("prompt_format", sa.String(), nullable=False),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("error", sa.Text()),
        sa.Column("outcome_success", sa.Boolean()),
        sa.Column("outcome_note", sa.Text()),
        sa.Column("outcome_at", UTC_DATE_TIME),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("request", JSON, nullable=False),
        sa.Column("demonstration_ids", JSON, nullable=False),
        sa.Column("prompt_system", sa.Text(), nullable=False),
        sa.Column("prompt_user", sa.Text(), nullable=False),
        sa.Column("reply_text", sa.Text()),
        sa.Column("actions", JSON),
        sa.Column("usage", JSON, nullable=False),
        sa.Column("timings_ms", JSON, nullable=False),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_predictions_task_tasks"),
        sa.PrimaryKeyConstraint("sequence", name="pk_predictions"),
        sa.UniqueConstraint("id", name="uq_predictions_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_predictions_task_sequence", "predictions", ["task", "sequence"])
    op.create_table(
        "idempotency_keys",
        sa.Column("scope", sa.String(64), nullable=False),
        sa.Column("key", sa.String(255), nullable=False),
        sa.Column("request_digest", sa.String(64), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("response", JSON, nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.PrimaryKeyConstraint("scope", "key", name="pk_idempotency_keys"),
    )


def downgrade() -> None:
    op.drop_table("idempotency_keys")
    op.drop_table("predictions")
    op.drop_table("episodes")
    op.drop_table("tasks")
