"""Object poses from what the robot sees.

An estimator takes what is known of objects (`base.ObjectQuery`) and the cameras' frames; it gives each object one pose,
or raises (`base.PoseEstimator`). An object's model (`models`) names its estimator, which `registry` knows.

From an image to poses: `cuboid` and `markers` look at one camera after another, find pixels that may be the object, and
fit its shape to depth and outline, or its markers to their corners. Each camera gives a `sightings.Sighting`: a pose, a
confidence, and a reason in words. `registered` takes all cameras together: points above the table -> `candidates` ->
`hypotheses`, each with a score.

From a doubt to a refusal: what lowers a confidence stands in `cuboid.judge`, `markers.estimator` and
`registered.decide`. A pose below its model's `min_confidence`, cameras that contradict each other, and several things
that may be meant are refused (`sightings.fused`, `registered.decide`), with object, cameras, numbers and a remedy.
"""
