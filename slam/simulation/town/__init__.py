"""A town grown around a drive: streets, houses and gardens, vegetation, furniture, traffic."""
