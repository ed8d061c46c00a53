"""Loop closure: places seen before, recognised by their descriptors."""
