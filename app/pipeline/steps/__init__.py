"""A sentence over several tasks as steps, each an instruction of one task."""
