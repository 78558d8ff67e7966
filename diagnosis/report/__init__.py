"""Put a diagnosis into words, and phases of a shift beside each other."""
