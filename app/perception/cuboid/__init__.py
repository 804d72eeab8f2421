"""Upright boxes and cylinders of known size and colour: found in RGB-D images, and learned from labelled ones."""
