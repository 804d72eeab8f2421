"""First tables."""

from alembic import op

from app.store.tables import metadata

revision = "2.0"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    metadata.create_all(op.get_bind())


def downgrade() -> None:
    metadata.drop_all(op.get_bind())
