"""Objects without a known shape: a template from labeled views is registered to the points of a scene."""
