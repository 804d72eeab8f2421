"""Object poses from what the robot sees.

An estimator takes object queries (`base.ObjectQuery`) and the cameras' frames; it returns one pose for each object or
raises (`base.PoseEstimator`). An object's model (`models`) names its estimator; `registry` maps names to estimators.

`cuboid`, for each camera: `segmentation` (pixels of its color -> pieces) -> `measurements` (surface points, outline
rays, ground) -> `fit` (robust least squares of a box or cylinder, `shape`) -> `confidence`; `estimator` groups these
sightings by object and selects one; `learn` makes models, `appearance` measures color and size for it.

`markers`, for each camera: `view` (ArUco, AprilTag: corners; depth on faces) -> `fit` -> `estimator` (confidence).

`registered`, all cameras together: `scene` (points above the table) -> `candidates` (parts of its colors) ->
`hypotheses` (`icp` from many starts) -> `score` (agreement of template and images) -> `decide` (one pose or a refusal,
with `image_faults`); `learn` merges labeled views to a template, completed under its `symmetry`; `marks` makes masks.

Refusals: `sightings.fused` and `registered.decide` refuse a pose below its model's `min_confidence`, cameras that
contradict each other, and several objects that match. The error names the object, cameras, numbers and a remedy.
"""
