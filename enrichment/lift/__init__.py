"""Lift, our network: the features it is given, the network, its loss. Running it needs ONNX Runtime alone."""
