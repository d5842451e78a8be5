"""Remote control: an analysis that serves HTTP and WebSocket, and its client."""
