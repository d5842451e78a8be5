"""Reports on a recording: figures, plots, pages, and comparison of two flights."""
