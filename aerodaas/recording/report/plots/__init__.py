"""A flight's pictures, one module each; no picture is read by colour alone."""
