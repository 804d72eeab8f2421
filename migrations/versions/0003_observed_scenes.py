"""What a prediction's robot saw: objects with their poses, and images."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

JSON = sa.JSON(none_as_null=True)


def upgrade() -> None:
    op.add_column("predictions", sa.Column("objects", JSON))
    op.add_column("predictions", sa.Column("cameras", JSON))


def downgrade() -> None:
    op.drop_column("predictions", "cameras")
    op.drop_column("predictions", "objects")
