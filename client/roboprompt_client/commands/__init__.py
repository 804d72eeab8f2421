"""What `roboprompt-robot` does, a module for each command or two."""
