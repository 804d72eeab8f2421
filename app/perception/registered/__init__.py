"""Objects by what they looked like: a template from labeled views, registered to the points of a scene."""
