"""What an instruction asks for: which objects it names, in which order, in how many clauses, and in which words."""

from app.pipeline.language.grounding import Grounded, Grounding, Taught
from app.pipeline.language.mentions import clauses, mention_order, template
from app.pipeline.language.space import Layout

__all__ = ["Grounded", "Grounding", "Layout", "Taught", "clauses", "mention_order", "template"]
