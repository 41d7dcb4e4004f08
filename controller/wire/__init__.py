"""Both ends of the UDP link: the controller's endpoint and its listeners, and the app's client."""
