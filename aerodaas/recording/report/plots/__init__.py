"""A flight's plots, one module each; none depends on colour alone."""
