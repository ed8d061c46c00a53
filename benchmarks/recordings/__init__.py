"""Reading of recordings and decoding of packets, compared with other decoders."""
