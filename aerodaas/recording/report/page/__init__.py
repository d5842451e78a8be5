"""Reports as single HTML files: no script, no font and no picture from elsewhere."""
