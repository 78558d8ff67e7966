"""Put a diagnosis into words."""
