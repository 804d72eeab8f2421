"""Keys for some tasks and for a time, what a key owns (predictions, repeated requests' answers), browsers' sessions."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

UTC_DATE_TIME = sa.DateTime(timezone=True)
PRIMARY_KEY = "pk_idempotency_keys"


def upgrade() -> None:
    op.add_column("api_keys", sa.Column("tasks", sa.JSON(none_as_null=True)))
    op.add_column("api_keys", sa.Column("expires_at", UTC_DATE_TIME))
    op.add_column("api_keys", sa.Column("last_used_at", UTC_DATE_TIME))
    op.add_column("predictions", sa.Column("key_id", sa.String(16)))
    op.create_index("ix_predictions_key_id_sequence", "predictions", ["key_id", "sequence"])
    with op.batch_alter_table("idempotency_keys") as table:
        table.add_column(sa.Column("owner", sa.String(16), nullable=False, server_default=""))
        table.drop_constraint(PRIMARY_KEY, type_="primary")
        table.create_primary_key(PRIMARY_KEY, ["scope", "owner", "key"])
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


def downgrade() -> None:
    op.drop_table("sessions")
    # Without owners a key's answers would be anybody's.
    op.execute("DELETE FROM idempotency_keys WHERE owner <> ''")
    with op.batch_alter_table("idempotency_keys") as table:
        table.drop_constraint(PRIMARY_KEY, type_="primary")
        table.create_primary_key(PRIMARY_KEY, ["scope", "key"])
        table.drop_column("owner")
    op.drop_index("ix_predictions_key_id_sequence", "predictions")
    op.drop_column("predictions", "key_id")
    for name in ("last_used_at", "expires_at", "tasks"):
        op.drop_column("api_keys", name)
