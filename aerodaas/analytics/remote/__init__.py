"""Remote control: an analysis that serves HTTP and WebSocket, and the client that speaks them."""
