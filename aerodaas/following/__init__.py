"""Following a target: its geometry, the controllers, and the room that an approach needs.

It may import `types` and `config`.
"""
