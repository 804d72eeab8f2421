"""First tables."""

import sqlalchemy as sa
from alembic import op

revision = "1.0"
down_revision = None
branch_labels = None
depends_on = None

JSON = sa.JSON(none_as_null=True)
UTC_DATE_TIME = sa.DateTime(timezone=True)
SEQUENCE_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "api_keys",
        sa.Column("id", sa.String(16), nullable=False),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("scopes", JSON, nullable=False),
        sa.Column("tasks", JSON),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("expires_at", UTC_DATE_TIME),
        sa.Column("revoked_at", UTC_DATE_TIME),
        sa.Column("last_used_at", UTC_DATE_TIME),
        sa.PrimaryKeyConstraint("id", name="pk_api_keys"),
    )
    op.create_table(
        "audit_log",
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("at", UTC_DATE_TIME, nullable=False),
        sa.Column("actor", sa.String(96), nullable=False),
        sa.Column("action", sa.String(32), nullable=False),
        sa.Column("subject", sa.String(255), nullable=False),
        sa.Column("details", sa.Text(), nullable=False),
        sa.Column("previous", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("number", name="pk_audit_log"),
    )
    op.create_table(
        "idempotency_keys",
        sa.Column("scope", sa.String(64), nullable=False),
        sa.Column("owner", sa.String(16), nullable=False),
        sa.Column("key", sa.String(255), nullable=False),
        sa.Column("request_digest", sa.String(64), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("response", JSON, nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.PrimaryKeyConstraint("scope", "owner", "key", name="pk_idempotency_keys"),
    )
    op.create_index("ix_idempotency_keys_created_at", "idempotency_keys", ["created_at"])
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
        sa.Column("prediction_id", sa.String(32)),
        sa.Column("left_out", sa.Boolean(), nullable=False),
        sa.Column("note", sa.String(500), nullable=False),
        sa.Column("uploaded_instruction", sa.String(500)),
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
    op.create_index("ix_episodes_task_instruction_sequence", "episodes", ["task", "instruction", "sequence"])
    op.create_index("ix_episodes_task_sequence", "episodes", ["task", "sequence"])
    op.create_table(
        "jobs",
        sa.Column("sequence", SEQUENCE_NUMBER, nullable=False),
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("changes", JSON, nullable=False),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("num_episodes", sa.Integer(), nullable=False),
        sa.Column("num_extracted", sa.Integer(), nullable=False),
        sa.Column("error", sa.Text()),
        sa.Column("claim", sa.String(32)),
        sa.Column("claimed_until", UTC_DATE_TIME, nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("finished_at", UTC_DATE_TIME),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_jobs_task_tasks"),
        sa.PrimaryKeyConstraint("sequence", name="pk_jobs"),
        sa.UniqueConstraint("id", name="uq_jobs_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_jobs_status_sequence", "jobs", ["status", "sequence"])
    op.create_table(
        "labels",
        sa.Column("sequence", SEQUENCE_NUMBER, nullable=False),
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("object", sa.String(64), nullable=False),
        sa.Column("episode_id", sa.String(32)),
        sa.Column("cameras", JSON, nullable=False),
        sa.Column("num_pixels", JSON, nullable=False),
        sa.Column("yaw_deg", sa.Float()),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_labels_task_tasks"),
        sa.PrimaryKeyConstraint("sequence", name="pk_labels"),
        sa.UniqueConstraint("id", name="uq_labels_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_labels_task_sequence", "labels", ["task", "sequence"])
    op.create_table(
        "predictions",
        sa.Column("sequence", SEQUENCE_NUMBER, nullable=False),
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("task", sa.String(64), nullable=False),
        sa.Column("key_id", sa.String(16)),
        sa.Column("instruction", sa.String(500), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("representation", sa.String(), nullable=False),
        sa.Column("prompt_format", sa.String(), nullable=False),
        sa.Column("step", sa.Integer()),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("error", sa.Text()),
        sa.Column("outcome_success", sa.Boolean()),
        sa.Column("outcome_note", sa.Text()),
        sa.Column("outcome_at", UTC_DATE_TIME),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("demonstration_ids", JSON, nullable=False),
        sa.Column("timings_ms", JSON, nullable=False),
        sa.Column("usage", JSON, nullable=False),
        sa.Column("cameras", JSON),
        sa.Column("request", JSON, nullable=False),
        sa.Column("objects", JSON, nullable=False),
        sa.Column("grounding", JSON, nullable=False),
        sa.Column("findings", JSON, nullable=False),
        sa.Column("prompt_system", sa.Text(), nullable=False),
        sa.Column("prompt_user", sa.Text(), nullable=False),
        sa.Column("reply_text", sa.Text()),
        sa.Column("actions", JSON),
        sa.Column("samples", JSON),
        sa.ForeignKeyConstraint(["task"], ["tasks.name"], name="fk_predictions_task_tasks"),
        sa.PrimaryKeyConstraint("sequence", name="pk_predictions"),
        sa.UniqueConstraint("id", name="uq_predictions_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_predictions_key_id_sequence", "predictions", ["key_id", "sequence"])
    op.create_index("ix_predictions_task_sequence", "predictions", ["task", "sequence"])
    op.create_table(
        "sessions",
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("key_id", sa.String(16), nullable=False),
        sa.Column("created_at", UTC_DATE_TIME, nullable=False),
        sa.Column("expires_at", UTC_DATE_TIME, nullable=False),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name="fk_sessions_key_id_api_keys"),
        sa.PrimaryKeyConstraint("digest", name="pk_sessions"),
    )
    op.create_index("ix_sessions_key_id", "sessions", ["key_id"])
    op.create_table(
        "staged_extractions",
        sa.Column("job", sa.String(32), nullable=False),
        sa.Column("episode", sa.String(32), nullable=False),
        sa.Column("keyframes", JSON, nullable=False),
        sa.Column("objects", JSON, nullable=False),
        sa.ForeignKeyConstraint(["job"], ["jobs.id"], name="fk_staged_extractions_job_jobs"),
        sa.PrimaryKeyConstraint("job", "episode", name="pk_staged_extractions"),
    )


def downgrade() -> None:
    op.drop_table("staged_extractions")
    op.drop_table("sessions")
    op.drop_table("predictions")
    op.drop_table("labels")
    op.drop_table("jobs")
    op.drop_table("episodes")
    op.drop_table("tasks")
    op.drop_table("idempotency_keys")
    op.drop_table("audit_log")
    op.drop_table("api_keys")
