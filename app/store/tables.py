"""The tables, as `migrations/` makes them (a test compares the two)."""

from sqlalchemy import (
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
)

from app.store.values import CameraRecord, Items, Json, KeyframeRecord, ObjectRecord, SequenceNumber, UtcDateTime

# Constraints that have names can be altered by a later migration on every database.
NAMING_CONVENTION = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


metadata = MetaData(naming_convention=NAMING_CONVENTION)

tasks = Table(
    "tasks",
    metadata,
    Column("name", String(64), primary_key=True),
    Column("version", Integer, nullable=False),
    Column("settings", Json, nullable=False),
    Column("object_names", Items()),
    Column("created_at", UtcDateTime, nullable=False),
    Column("updated_at", UtcDateTime, nullable=False),
)

# The trajectory comes last, as prompts do below: SQLite walks through all that stands before what it reads.
episodes = Table(
    "episodes",
    metadata,
    Column("sequence", SequenceNumber, primary_key=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("task", String(64), ForeignKey("tasks.name"), nullable=False),
    Column("instruction", String(500), nullable=False),
    Column("num_frames", Integer, nullable=False),
    Column("control_frequency_hz", Float, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("prediction_id", String(32)),
    Column("corrects", String(32), index=True),
    Column("left_out", Boolean, nullable=False),
    Column("note", String(500), nullable=False),
    Column("uploaded_instruction", String(500)),
    Column("upload_key", String(200), unique=True),
    Column("upload_digest", String(64)),
    Column("findings", Items(), nullable=False),
    Column("keyframes_key", String(16), nullable=False),
    Column("poses_key", String(16), nullable=False),
    Column("objects", Items(ObjectRecord), nullable=False),
    Column("keyframes", Items(KeyframeRecord), nullable=False),
    Column("cameras", Items(CameraRecord), nullable=False),
    Column("given_objects", Items(), nullable=False),
    Column("extra", Json, nullable=False),
    Column("trajectory", LargeBinary, nullable=False),
    Index(None, "task", "sequence"),
    Index(None, "task", "instruction", "sequence"),
    sqlite_autoincrement=True,  # a deleted episode's number is never given again: cursors stay valid
)

predictions = Table(
    "predictions",
    metadata,
    Column("sequence", SequenceNumber, primary_key=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("task", String(64), ForeignKey("tasks.name"), nullable=False),
    Column("instruction", String(500), nullable=False),
    Column("model", String, nullable=False),
    Column("representation", String, nullable=False),
    Column("prompt_format", String, nullable=False),
    Column("status", String(16), nullable=False),
    Column("error", Text),
    Column("outcome_success", Boolean),
    Column("outcome_note", Text),
    Column("outcome_at", UtcDateTime),
    Column("created_at", UtcDateTime, nullable=False),
    Column("demonstration_ids", Items(), nullable=False),
    Column("timings_ms", Json, nullable=False),
    Column("usage", Json, nullable=False),
    Column("cameras", Items(CameraRecord)),
    Column("request", Json, nullable=False),
    Column("objects", Items(ObjectRecord), nullable=False),
    Column("grounding", Json, nullable=False),
    Column("findings", Items(), nullable=False),
    Column("prompt_system", Text, nullable=False),
    Column("prompt_user", Text, nullable=False),
    Column("reply_text", Text),
    Column("actions", Items()),
    Index(None, "task", "sequence"),
    sqlite_autoincrement=True,
)

api_keys = Table(
    "api_keys",
    metadata,
    Column("id", String(16), primary_key=True),
    Column("name", String(64), nullable=False),
    Column("digest", String(64), nullable=False),
    Column("scope", String(16), nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("revoked_at", UtcDateTime),
)

# What an object of a task looks like, by masks; its cameras' images are kept even if their episode is deleted.
labels = Table(
    "labels",
    metadata,
    Column("sequence", SequenceNumber, primary_key=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("task", String(64), ForeignKey("tasks.name"), nullable=False),
    Column("object", String(64), nullable=False),
    Column("episode_id", String(32)),
    Column("cameras", Items(CameraRecord), nullable=False),
    Column("num_pixels", Json, nullable=False),
    Column("yaw_deg", Float),
    Column("created_at", UtcDateTime, nullable=False),
    Index(None, "task", "sequence"),
    sqlite_autoincrement=True,
)
