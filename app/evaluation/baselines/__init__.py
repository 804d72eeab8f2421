"""Methods that RoboPrompt is compared with. Of the service they need only what it has stored of a task."""
