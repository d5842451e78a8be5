"""The API over HTTP: admission, bounds, refusals, and the page."""
