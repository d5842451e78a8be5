"""A cluster of network namespaces on one machine: real Ray nodes behind shaped links."""

from tools.namespaces.edge_cloud import EdgeCloud
from tools.namespaces.shape import Shape

__all__ = ["EdgeCloud", "Shape"]
