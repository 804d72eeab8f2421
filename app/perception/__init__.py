"""Object poses from what the robot sees.

An estimator takes object queries (`base.ObjectQuery`) and the cameras' frames; it returns one pose for each object or
raises (`base.PoseEstimator`). An object's model (`models`) names its estimator; `registry` maps names to estimators.

From images to poses: `cuboid` and `markers` process each camera by itself. They segment pixels that may be the object
and fit its shape to depth and outline, or its markers to their corners. Each camera yields a `sightings.Sighting`: a
pose, a confidence and a reason. `registered` uses all cameras together: `scene` (points above the table) ->
`candidates` -> `hypotheses` with scores -> `decide` (one of them, or a refusal); `learn` makes its templates.

Refusals: `cuboid.judge`, `markers.estimator` and `registered.decide` compute confidences. `sightings.fused` and
`registered.decide` refuse a pose below its model's `min_confidence`, cameras that contradict each other, and several
objects that match. The error names the object, the cameras, the numbers and a remedy.
"""
