"""What recordings are decoded to, beside the makers' own decoders."""
