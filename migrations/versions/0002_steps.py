"""Steps of closed loops."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("predictions", sa.Column("step", sa.Integer()))


def downgrade() -> None:
    op.drop_column("predictions", "step")
