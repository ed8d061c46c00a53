"""Training of networks on recorded sequences: samples, packs, random examples, the training loop."""
