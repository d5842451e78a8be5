"""The application as a graph: streams, handles, navigation, and the paper's interfaces and names.

It may import `types` and `config`.
"""
