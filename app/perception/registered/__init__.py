"""Objects by what they looked like: a template from labelled views, registered to the points of a scene."""
