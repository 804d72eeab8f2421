"""What in a prediction deserves a look."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("predictions", sa.Column("findings", sa.JSON(none_as_null=True)))


def downgrade() -> None:
    op.drop_column("predictions", "findings")
