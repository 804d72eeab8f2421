"""What an instruction asks for: which objects it names, in which order, in how many clauses, and in which words."""
