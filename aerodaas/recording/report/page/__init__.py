"""Reports as single HTML files without scripts or external fonts and images."""
