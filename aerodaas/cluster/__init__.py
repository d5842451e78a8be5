"""Clusters: one of namespaces on this machine, and the examination of any.

Part of the package, not of the folder `clusters/`, for commands need it wherever AeroDaaS is
installed; `clusters/` holds the files that people copy and change.
"""

from aerodaas.cluster.edge_cloud import EdgeCloud
from aerodaas.cluster.shape import Shape

__all__ = ["EdgeCloud", "Shape"]
