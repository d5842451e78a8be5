"""Inference endpoints over HTTP, as compute resources for analyses.

`analysis.endpoint_analysis` wraps an analysis so that its inference runs at an endpoint, by the
Open Inference Protocol (KServe v2) or at a plain function's URL.
"""
