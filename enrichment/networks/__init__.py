"""The paper's networks in PyTorch. Training imports them; running them needs ONNX Runtime alone."""
