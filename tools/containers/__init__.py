"""Builds the container's image without a container engine, in folders."""
