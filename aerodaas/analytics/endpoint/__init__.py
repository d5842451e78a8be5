"""Inference endpoints over HTTP, as a place where analyses run.

`analysis.endpoint_analysis` puts an analysis before an endpoint: what it does in `process` then
happens there, by the Open Inference Protocol (KServe v2) or at a plain function's URL.
"""
