"""Recipes and benches: read, validated by the plugins' own models, every problem at its line."""
