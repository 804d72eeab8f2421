"""What demonstrations of an instruction share: one probabilistic model."""
