"""Methods that RoboPrompt is compared with. They need nothing of the service but what it knows of a task."""
