"""One run: from an application's graph to actors, their membership, growth, and shutdown."""
