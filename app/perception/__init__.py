"""Object poses from what the robot sees: estimators by name in `registry`, each a `base.PoseEstimator`."""
