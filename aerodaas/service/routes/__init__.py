"""HTTP and WebSocket routes, one module a subject; each only translates between JSON and the desk."""
