"""Upright boxes and cylinders of known size and color: found in RGB-D images, and learned from labeled ones."""
