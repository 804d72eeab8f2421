"""How a prediction's instruction was understood."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("predictions", sa.Column("grounding", sa.JSON(none_as_null=True)))


def downgrade() -> None:
    op.drop_column("predictions", "grounding")
