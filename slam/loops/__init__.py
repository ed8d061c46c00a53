"""Loop closure: place recognition by descriptors, and verification by registration."""
