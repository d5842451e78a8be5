"""What a simulated world looks like: meshes, textures and the nodes made of them."""
