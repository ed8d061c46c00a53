"""Roads without a town: motorway, bridge, and streets full of lorries or of traffic."""
