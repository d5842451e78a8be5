"""HTTP and WebSocket routes, a module a subject: between JSON and the services behind them."""
