"""Values with units that robot and service share, checked when they are made: poses, trajectories, cameras, names."""
