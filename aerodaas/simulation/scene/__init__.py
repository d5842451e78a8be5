"""Appearance of a simulated world: meshes, textures and panda3d nodes."""
