"""What demonstrations of an instruction share: one probabilistic model."""

from app.pipeline.skill.skill import Skill, fit

__all__ = ["Skill", "fit"]
