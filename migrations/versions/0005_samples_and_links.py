"""The replies that a prediction is a statistic of, and episodes that carried a prediction out."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("predictions", sa.Column("samples", sa.JSON(none_as_null=True)))
    op.add_column("episodes", sa.Column("prediction_id", sa.String(32)))


def downgrade() -> None:
    op.drop_column("episodes", "prediction_id")
    op.drop_column("predictions", "samples")
