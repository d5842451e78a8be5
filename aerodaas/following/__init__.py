"""Target following: geometry, controllers, and clearance for the approach.

It may import `types` and `config`.
"""
