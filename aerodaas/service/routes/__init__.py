"""HTTP and WebSocket routes, a module a subject: between JSON and the desk, no more."""
