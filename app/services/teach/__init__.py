"""Episodes -> what a task knows: uploaded, extracted, checked, and its settings and object models."""
