"""Reports as single HTML files: no script, no font and no image from elsewhere."""
