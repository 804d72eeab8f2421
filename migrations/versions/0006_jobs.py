"""Durable jobs: a large task's re-extraction, and what it has extracted so far."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

JSON = sa.JSON(none_as_null=True)
UTC_DATE_TIME = sa.DateTime(timezone=True)
SEQUENCE_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
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
    op.drop_table("jobs")
