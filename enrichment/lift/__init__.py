"""Lift, our network: features, network and loss. Running it requires ONNX Runtime only."""
