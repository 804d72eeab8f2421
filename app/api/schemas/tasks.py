"""Answers about tasks: settings and their changes, statistics."""

from typing import Annotated

from pydantic import BaseModel, Field

from app.services.task_settings import TaskSettings


class TaskOut(TaskSettings):
    """A task: its settings, objects and number of episodes."""

    name: str
    version: int
    object_names: list[str] | None
    num_episodes: int
    note: Annotated[
        str, Field(description="which episodes the settings do not apply to; empty if all, and in lists")
    ] = ""


class TaskList(BaseModel):
    """Every task."""

    tasks: list[TaskOut]


class StandingOut(BaseModel):
    """How predictions ended. Success rate and interval count only predictions with a reported outcome."""

    predictions: int
    errors: Annotated[int, Field(description="predictions without actions: the LLM failed, or its reply was not valid")]
    successes: int
    failures: int
    success_rate: Annotated[float | None, Field(description="null if no outcome was reported")]
    interval: Annotated[tuple[float, float], Field(description="Wilson's 95 % interval of the success rate")]


class ConfigurationOut(StandingOut):
    """A configuration of model and prompt, and how its predictions ended."""

    model: str
    representation: str
    prompt_format: str
    selection: Annotated[str | None, Field(description="null if the request named its episodes")]
    num_demonstrations: int
    is_yardstick: Annotated[bool, Field(description="true: a baseline that computes replies without an LLM")]


class TaskStatsOut(StandingOut):
    """A task's predictions together and by configuration, most reliable success first."""

    task: str
    configurations: list[ConfigurationOut]
