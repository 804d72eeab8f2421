"""What happens between observing a scene and moving the arm: the loop, plans of several tasks, and looking again."""
