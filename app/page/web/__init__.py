"""The page on the network: routes, who may come in, pictures, and the WebSocket."""
