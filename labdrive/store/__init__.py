"""Run folders and what is in them, on disk: whole or absent, whatever happens. Locks."""
