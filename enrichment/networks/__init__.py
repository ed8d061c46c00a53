"""The paper's networks in PyTorch, for training; running them requires ONNX Runtime only."""
